// The page of the Handeye Workbench: shows the frames that `handeye serve` draws, and sends the user's input.
// The messages are described in docs/reference/browser.md.
'use strict';

const element = (id) => document.getElementById(id);
const [canvas, typing, bar, barText, driveButton, stopButton, keyboardButton, note] =
  ['frame', 'typing', 'bar', 'bar-text', 'drive', 'stop', 'keyboard', 'note'].map(element);

/// Interval of reports while something is held down [ms]; without them, the window releases it.
const RENEWAL_MS = 50;
/// Delay between two attempts to connect: first and longest [ms].
const RETRY_MS = [300, 4000];
/// Longest silence of the server before the display counts as stale [ms]. The server reports every second that it is alive.
const STALE_MS = 4000;
/// Longest silence of the server before the connection is made again [ms].
const SILENCE_MS = 15000;
/// Longest text that is pasted at once [characters]; the server accepts no more.
const MOST_PASTED = 4096;

let words = {
  watching: 'You are watching', nobody: 'Nobody drives', drive: 'Drive', stop: 'STOP',
  lost: 'The connection to the workbench is lost. What is shown is of {time}, and STOP does not act from here: use the '
    + 'emergency stop of the robot', uploading: 'Uploading…',
  not_uploaded: 'The files could not be uploaded',
};
let people = { you: true, driven: true, pages: 1 };
/// Whether touch input is used here: the on-screen keyboard then only appears on request.
let touched = matchMedia('(pointer: coarse)').matches;

// ---------------------------------------------------------------- the frame

/// What is on the screen, drawn by painter.js.
const show = {
  frame: null,
  painter: new Worker('/painter.js'),

  begin() {
    const surface = canvas.transferControlToOffscreen();
    this.painter.postMessage({ canvas: surface }, [surface]);
    this.painter.onmessage = ({ data }) => this.heard(data);
  },

  heard(data) {
    // Drawing restarts after a restart of the graphics driver.
    if (data.lost) { setTimeout(() => location.reload(), 500); return; }
    if (data.lost === false) { sayNote(data.failed); return; }
    if (data.connection !== connection.count) return;
    if (data.failed) { connection.again(); return; }
    this.frame = { size: data.size };
    canvas.style.cursor = people.you ? data.cursor : 'default';
    fit();
    placeTyping(data.typing);
    connection.send({ t: 'shown', number: data.number });
  },

  /// A position on the page in points of the frame.
  pointOf(event) {
    const area = canvas.getBoundingClientRect();
    const size = this.frame?.size ?? [area.width, area.height];
    return [(event.clientX - area.left) * size[0] / area.width, (event.clientY - area.top) * size[1] / area.height];
  },
};

/// Scales the frame to the available room; on the driving page, it is drawn for this room.
function fit() {
  if (!show.frame) return;
  const stage = element('stage');
  const [width, height] = show.frame.size;
  const scale = Math.min(stage.clientWidth / width, stage.clientHeight / height);
  canvas.style.width = `${width * scale}px`;
  canvas.style.height = `${height * scale}px`;
}

// ---------------------------------------------------------------- connection

class Connection {
  constructor() {
    this.retry = RETRY_MS[0];
    /// When the server last sent something.
    this.heard = new Date();
    /// Number of connections so far.
    this.count = 0;
    this.name = sessionStorage.getItem('page') ?? [...crypto.getRandomValues(new Uint8Array(12))]
      .map((byte) => byte.toString(16).padStart(2, '0')).join('');
    sessionStorage.setItem('page', this.name);
    this.open();
  }

  open() {
    clearTimeout(this.timer);
    const socket = new WebSocket(`${location.origin.replace(/^http/, 'ws')}/socket?page=${this.name}`);
    socket.binaryType = 'arraybuffer';
    this.socket = socket;
    socket.onopen = () => {
      if (socket !== this.socket) return;
      this.retry = RETRY_MS[0];
      this.count += 1;
      show.painter.postMessage({ connection: this.count });
      sayScreen();
      this.send({ t: 'visible', visible: !document.hidden });
      if (reader.on) reader.say();
    };
    socket.onmessage = ({ data }) => {
      if (socket !== this.socket) return;
      this.heard = new Date();
      this.watch();
      sayStale(null);
      if (data instanceof ArrayBuffer) show.painter.postMessage({ frame: data }, [data]);
      else heard(JSON.parse(data));
    };
    socket.onclose = () => {
      if (socket !== this.socket) return;
      sayStale(this.heard);
      letGo();
      this.timer = setTimeout(() => this.open(), this.retry);
      this.retry = Math.min(this.retry * 2, RETRY_MS[1]);
    };
    this.watch();
  }

  /// A lost network reports nothing, not even its loss.
  watch() {
    clearTimeout(this.watchdog);
    clearTimeout(this.stale);
    this.stale = setTimeout(() => sayStale(this.heard), STALE_MS);
    this.watchdog = setTimeout(() => this.again(), SILENCE_MS);
  }

  again() {
    const { socket } = this;
    this.socket = null;
    socket?.close();
    sayStale(this.heard);
    this.open();
  }

  send(said) {
    if (this.socket?.readyState === WebSocket.OPEN) this.socket.send(JSON.stringify(said));
  }
}

function heard(told) {
  if (told.t === 'people') {
    people = told;
    if (!people.you) letGo();
    sayBar();
    sayScreen();
  } else if (told.t === 'words') {
    words = told;
    document.documentElement.lang = told.language;
    reader.button.textContent = words.reads;
    sayBar();
  } else if (told.t === 'controls') {
    // It may have been in flight when it was switched off.
    if (reader.on) reader.show(told.controls);
  } else if (told.t === 'copy') {
    copy(told.text);
  } else if (told.t === 'visit') {
    visit(told.url);
  }
}

function sayBar() {
  bar.hidden = people.you;
  barText.textContent = people.driven ? words.watching : words.nobody;
  driveButton.textContent = words.drive;
  stopButton.textContent = words.stop;
  fit();
}

/// The display is stale since a time, or is live again: if stale it is grey, and STOP, which has no effect then, shows that.
let isStale = false;
function sayStale(since) {
  if (isStale === Boolean(since)) return;
  isStale = Boolean(since);
  document.body.classList.toggle('stale', isStale);
  driveButton.disabled = stopButton.disabled = isStale;
  sayNote(since ? words.lost.replace('{time}', since.toLocaleTimeString()) : '');
}

function sayNote(text, quiet = false) {
  note.hidden = !text;
  note.textContent = text;
  note.classList.toggle('quiet', quiet);
}

function sayScreen() {
  if (!people.you) return;
  const stage = element('stage');
  const [width, height] = [stage.clientWidth, stage.clientHeight];
  if (width < 100 || height < 100) return;
  const scale = Math.min(Math.max(devicePixelRatio, 0.5), 4);
  connection.send({ t: 'screen', width, height, scale, touch: touched });
}

async function copy(text) {
  if (navigator.clipboard) {
    try { return await navigator.clipboard.writeText(text); } catch { /* Without the permission, use the fallback. */ }
  }
  typing.value = text;
  typing.select();
  document.execCommand('copy');
  typing.value = '';
}

function visit(url) {
  const link = document.createElement('a');
  link.href = url;
  if (url.startsWith('/download')) link.download = '';
  else link.target = '_blank';
  link.rel = 'noopener noreferrer';
  link.click();
}

// ---------------------------------------------------------------- input of the user

let pending = [];
const down = { buttons: new Set(), keys: new Map(), touches: new Set() };
let renewal = 0;

function done(event) {
  if (!people.you) return;
  if (!pending.length) queueMicrotask(flush);
  const last = pending[pending.length - 1];
  if (event.e === 'move' && last?.e === 'move') pending[pending.length - 1] = event;
  else pending.push(event);
}

function flush() {
  const events = pending;
  pending = [];
  if (events.length) connection.send({ t: 'input', events });
}

/// As long as something is held down and the page is in front, this is reported to the window.
function renew() {
  const held = down.buttons.size || down.keys.size || down.touches.size;
  if (held && !renewal) renewal = setInterval(() => connection.send({ t: 'held' }), RENEWAL_MS);
  if (!held) {
    clearInterval(renewal);
    renewal = 0;
  }
}

/// Nothing is held down any more, as far as this page knows; the window releases it when the reports stop.
function letGo() {
  for (const held of Object.values(down)) held.clear();
  renew();
}

/// The first characters of a text; a surrogate pair is not cut in two.
const cut = (text) => (text.length > MOST_PASTED ? [...text.slice(0, 2 * MOST_PASTED)].slice(0, MOST_PASTED).join('') : text);

const modifiersOf = (event) =>
  (event.altKey ? 1 : 0) | (event.ctrlKey ? 2 : 0) | (event.shiftKey ? 4 : 0) | (event.metaKey ? 8 : 0);

function pointer(event) {
  touched = event.pointerType === 'touch';
  const at = show.pointOf(event);
  if (touched) return finger(event, at);
  if (event.type === 'pointermove') return done({ e: 'move', at });
  const isDown = event.type === 'pointerdown';
  if (event.type === 'pointercancel') return letGo();
  if (isDown) {
    canvas.setPointerCapture(event.pointerId);
    typing.focus({ preventScroll: true });
  }
  if (isDown) down.buttons.add(event.button);
  else down.buttons.delete(event.button);
  done({ e: 'button', at, button: event.button, down: isDown, modifiers: modifiersOf(event) });
  renew();
}

function finger(event, at) {
  const phase = { pointerdown: 'start', pointermove: 'move', pointerup: 'end', pointercancel: 'cancel' }[event.type];
  if (phase === 'move' && !down.touches.has(event.pointerId)) return;
  if (phase === 'start') {
    canvas.setPointerCapture(event.pointerId);
    down.touches.add(event.pointerId);
  } else if (phase !== 'move') {
    down.touches.delete(event.pointerId);
  }
  done({ e: 'touch', id: event.pointerId >>> 0, at, phase, first: event.isPrimary });
  renew();
}

for (const kind of ['pointerdown', 'pointermove', 'pointerup', 'pointercancel']) {
  canvas.addEventListener(kind, (event) => { event.preventDefault(); pointer(event); });
}
canvas.addEventListener('pointerleave', (event) => { if (event.pointerType !== 'touch') done({ e: 'leave' }); });
canvas.addEventListener('contextmenu', (event) => event.preventDefault());
canvas.addEventListener('wheel', (event) => {
  event.preventDefault();
  const lines = event.deltaMode === WheelEvent.DOM_DELTA_LINE;
  done({ e: 'wheel', by: [-event.deltaX, -event.deltaY], lines, modifiers: modifiersOf(event) });
}, { passive: false });

/// Keys that have an action in the browser, and that the window uses.
const OURS = new Set(['Tab', 'F1', 'Escape', 'ArrowUp', 'ArrowDown', 'ArrowLeft', 'ArrowRight', 'PageUp', 'PageDown',
  'Home', 'End', 'Delete', 'Backspace', 'Enter', 'Alt']);
const OURS_WITH_CTRL = new Set(['k', 'p', 's', 'o', 'z', 'y', 'a', 'n', 'f', 'Enter']);

document.addEventListener('keydown', (event) => {
  if (event.target instanceof HTMLButtonElement && event.key !== 'Escape') return;
  if (event.isComposing || event.keyCode === 229) return;
  if (event.key === 'Escape') connection.send({ t: 'stop' });
  const withCtrl = event.ctrlKey || event.metaKey;
  const letter = event.key.length === 1 ? event.key.toLowerCase() : event.key;
  if (withCtrl ? OURS_WITH_CTRL.has(letter) : OURS.has(event.key)) event.preventDefault();
  // The clipboard has events of its own.
  if (withCtrl && ['c', 'x', 'v'].includes(letter)) return;
  down.keys.set(event.code, event.key);
  renew();
  done({ e: 'key', key: event.key, down: true, modifiers: modifiersOf(event) });
});
document.addEventListener('keyup', (event) => {
  const key = down.keys.get(event.code);
  down.keys.delete(event.code);
  renew();
  if (key !== undefined) done({ e: 'key', key, down: false, modifiers: modifiersOf(event) });
});

typing.addEventListener('compositionupdate', (event) => done({ e: 'compose', text: cut(event.data) }));
typing.addEventListener('compositionend', (event) => {
  done({ e: 'composed', text: cut(event.data) });
  typing.value = '';
});
typing.addEventListener('input', (event) => {
  if (event.isComposing) return;
  if (event.inputType === 'deleteContentBackward' && !down.keys.size) {
    // An on-screen keyboard deletes without a key event.
    for (const isDown of [true, false]) done({ e: 'key', key: 'Backspace', down: isDown, modifiers: 0 });
  } else if (event.data && event.inputType !== 'insertCompositionText') {
    done({ e: 'text', text: cut(event.data) });
  }
  typing.value = '';
});
document.addEventListener('copy', (event) => { event.preventDefault(); done({ e: 'copy' }); });
document.addEventListener('cut', (event) => { event.preventDefault(); done({ e: 'cut' }); });
document.addEventListener('paste', (event) => {
  event.preventDefault();
  done({ e: 'paste', text: cut(event.clipboardData.getData('text/plain')) });
});

/// Positions the on-screen keyboard and the candidates of an input method where text is typed.
function placeTyping(place) {
  const wanted = Boolean(place) && people.you;
  keyboardButton.hidden = !(wanted && touched && document.activeElement !== typing);
  if (!wanted) {
    if (touched && document.activeElement === typing) typing.blur();
    return;
  }
  const area = canvas.getBoundingClientRect();
  const stage = element('stage').getBoundingClientRect();
  const scale = area.width / show.frame.size[0];
  typing.style.left = `${area.left - stage.left + place.cursor[0] * scale}px`;
  typing.style.top = `${area.top - stage.top + place.cursor[1] * scale}px`;
}
keyboardButton.addEventListener('click', () => { typing.focus(); keyboardButton.hidden = true; });

driveButton.addEventListener('click', () => connection.send({ t: 'drive' }));
stopButton.addEventListener('click', () => connection.send({ t: 'stop' }));

document.addEventListener('visibilitychange', () => {
  if (document.hidden) letGo();
  connection.send({ t: 'visible', visible: !document.hidden });
});
addEventListener('blur', () => { letGo(); done({ e: 'focus', focused: false }); });
addEventListener('focus', () => { done({ e: 'focus', focused: true }); if (!touched) typing.focus(); });
addEventListener('resize', () => { sayScreen(); fit(); });

// ---------------------------------------------------------------- screen readers

/// The controls of the window as elements, for a screen reader to read and to press.
const reader = {
  on: false,
  button: element('reads'),
  list: element('controls'),
  /// Elements by the id of their control.
  elements: new Map(),

  say() {
    this.button.setAttribute('aria-pressed', String(this.on));
    connection.send({ t: 'reads', reads: this.on });
    if (!this.on) this.show([]);
  },

  show(controls) {
    const wanted = new Set(controls.map(({ id }) => id));
    for (const [id, shown] of this.elements) {
      if (!wanted.has(id)) { shown.remove(); this.elements.delete(id); }
    }
    let last = null;
    for (const control of controls) {
      const shown = this.element(control);
      // An element that is not moved keeps the keyboard focus.
      const next = last ? last.nextSibling : this.list.firstChild;
      if (shown !== next) this.list.insertBefore(shown, next);
      last = shown;
    }
  },

  element({ id, role, label, enabled, pressed }) {
    let shown = this.elements.get(id);
    if (!shown || shown.dataset.role !== String(role)) {
      shown?.remove();
      shown = document.createElement(role ? 'button' : 'p');
      shown.dataset.role = String(role);
      if (role) {
        shown.type = 'button';
        if (role !== 'button') shown.setAttribute('role', role);
        shown.addEventListener('click', () => {
          const isTyped = role === 'textbox';
          done({ e: 'control', id, press: !isTyped });
          // From there, keys are sent to the window.
          if (isTyped) typing.focus({ preventScroll: true });
        });
        shown.addEventListener('focus', () => done({ e: 'control', id, press: false }));
      }
      this.elements.set(id, shown);
    }
    if (shown.textContent !== label) shown.textContent = label;
    if (role) {
      shown.setAttribute('aria-disabled', String(!enabled));
      const state = role === 'button' || role === 'combobox' || role === 'link' ? 'aria-pressed' : 'aria-checked';
      if (pressed === null) shown.removeAttribute(state);
      else shown.setAttribute(state, String(pressed));
    }
    return shown;
  },
};
reader.button.addEventListener('click', () => { reader.on = !reader.on; reader.say(); });

// ---------------------------------------------------------------- files

/// Every dropped file, with its path relative to the dropped entry.
async function filesOf(entry, path = '') {
  const name = path + entry.name;
  if (entry.isFile) return [[name, await new Promise((resolve, reject) => entry.file(resolve, reject))]];
  const reader = entry.createReader();
  const files = [];
  for (;;) {
    const some = await new Promise((resolve, reject) => reader.readEntries(resolve, reject));
    if (!some.length) return files;
    for (const inner of some) files.push(...await filesOf(inner, `${name}/`));
  }
}

async function upload(entries) {
  const name = [...crypto.getRandomValues(new Uint8Array(8))].map((byte) => byte.toString(16).padStart(2, '0')).join('');
  const files = (await Promise.all(entries.map((entry) => filesOf(entry)))).flat();
  for (const [index, [path, file]] of files.entries()) {
    sayNote(`${words.uploading} ${index + 1}/${files.length}`, true);
    const target = `/upload/${name}/${path.split('/').map(encodeURIComponent).join('/')}`;
    const answer = await fetch(target, { method: 'POST', body: file, headers: { 'x-handeye': '1' } });
    if (!answer.ok) throw new Error(`${path}: ${await answer.text()}`);
  }
  sayNote('');
  if (files.length) connection.send({ t: 'open', upload: name });
}

addEventListener('dragover', (event) => event.preventDefault());
addEventListener('drop', (event) => {
  event.preventDefault();
  if (!people.you) return;
  const entries = [...event.dataTransfer.items].map((item) => item.webkitGetAsEntry()).filter(Boolean);
  upload(entries).catch((error) => {
    sayNote(`${words.not_uploaded}: ${error.message}`);
    setTimeout(() => sayNote(''), 8000);
  });
});

const connection = new Connection();
show.begin();
if (!touched) typing.focus();
