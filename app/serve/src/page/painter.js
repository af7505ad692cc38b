// Draws the frames that `handeye serve` sends, on a thread of its own: the page stays free for the user's input, and
// reports in time that a button is still held. The messages are described in docs/reference/browser.md.
'use strict';

class Painter {
  constructor(canvas) {
    this.canvas = canvas;
    const gl = canvas.getContext('webgl2', { alpha: false, antialias: false, depth: false, stencil: false });
    if (!gl) throw new Error('This browser has no WebGL 2.');
    this.gl = gl;
    this.textures = new Map();
    this.vertices = new Uint8Array(0);
    this.indices = new Uint32Array(0);
    this.program = this.compiled(`#version 300 es
      uniform vec2 size;
      in vec2 place; in vec2 spot; in vec4 colour;
      out vec2 at; out vec4 tint;
      void main() {
        gl_Position = vec4(2.0 * place.x / size.x - 1.0, 1.0 - 2.0 * place.y / size.y, 0.0, 1.0);
        at = spot; tint = colour;
      }`, `#version 300 es
      precision mediump float;
      uniform sampler2D image;
      in vec2 at; in vec4 tint;
      out vec4 painted;
      void main() { painted = tint * texture(image, at); }`);
    this.size = gl.getUniformLocation(this.program, 'size');
    this.vertexBuffer = gl.createBuffer();
    this.indexBuffer = gl.createBuffer();
    gl.bindVertexArray(gl.createVertexArray());
    gl.bindBuffer(gl.ARRAY_BUFFER, this.vertexBuffer);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, this.indexBuffer);
    const attribute = (name, count, type, normalized, offset) => {
      const place = gl.getAttribLocation(this.program, name);
      gl.enableVertexAttribArray(place);
      gl.vertexAttribPointer(place, count, type, normalized, 20, offset);
    };
    attribute('place', 2, gl.FLOAT, false, 0);
    attribute('spot', 2, gl.FLOAT, false, 8);
    attribute('colour', 4, gl.UNSIGNED_BYTE, true, 16);
    gl.useProgram(this.program);
    gl.enable(gl.BLEND);
    gl.enable(gl.SCISSOR_TEST);
    // Colours come multiplied by their alpha.
    gl.blendFuncSeparate(gl.ONE, gl.ONE_MINUS_SRC_ALPHA, gl.ONE_MINUS_DST_ALPHA, gl.ONE);
    gl.pixelStorei(gl.UNPACK_COLORSPACE_CONVERSION_WEBGL, gl.NONE);
    gl.pixelStorei(gl.UNPACK_PREMULTIPLY_ALPHA_WEBGL, false);
  }

  compiled(...sources) {
    const gl = this.gl;
    const program = gl.createProgram();
    [gl.VERTEX_SHADER, gl.FRAGMENT_SHADER].forEach((kind, index) => {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, sources[index]);
      gl.compileShader(shader);
      if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
      gl.attachShader(program, shader);
    });
    gl.linkProgram(program);
    return program;
  }

  /// A texture or a part of one: pixels as RGBA bytes, or a decoded image.
  setTexture(part, pixels) {
    const gl = this.gl;
    let texture = this.textures.get(part.id);
    if (!texture) this.textures.set(part.id, texture = gl.createTexture());
    gl.bindTexture(gl.TEXTURE_2D, texture);
    const [width, height] = part.size;
    const isImage = pixels instanceof ImageBitmap;
    if (part.at) {
      gl.texSubImage2D(gl.TEXTURE_2D, 0, part.at[0], part.at[1], width, height, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
      return;
    }
    if (isImage) gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
    else gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, width, height, 0, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
    const filter = part.nearest ? gl.NEAREST : gl.LINEAR;
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, filter);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.LINEAR);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_T, gl.CLAMP_TO_EDGE);
  }

  freeTexture(id) {
    this.gl.deleteTexture(this.textures.get(id) ?? null);
    this.textures.delete(id);
  }

  /// All chunks of a frame; neighbours with one texture and one clip rectangle are drawn at once.
  paint(frame) {
    const gl = this.gl;
    const [width, height] = frame.size.map((points) => Math.round(points * frame.scale));
    if (this.canvas.width !== width || this.canvas.height !== height) {
      this.canvas.width = width;
      this.canvas.height = height;
    }
    let [vertexCount, indexCount] = [0, 0];
    for (const chunk of frame.chunks) {
      vertexCount += chunk.vertexCount;
      indexCount += chunk.indices.length;
    }
    if (this.vertices.length < vertexCount * 20) this.vertices = new Uint8Array(vertexCount * 30);
    if (this.indices.length < indexCount) this.indices = new Uint32Array(Math.ceil(indexCount * 1.5));
    const runs = [];
    let [vertex, index] = [0, 0];
    for (const chunk of frame.chunks) {
      this.vertices.set(chunk.vertices, vertex * 20);
      for (let i = 0; i < chunk.indices.length; i++) this.indices[index + i] = chunk.indices[i] + vertex;
      const last = runs[runs.length - 1];
      const joins = last && last.texture === chunk.texture && last.clip.every((edge, i) => edge === chunk.clip[i]);
      if (joins) last.count += chunk.indices.length;
      else runs.push({ texture: chunk.texture, clip: chunk.clip, start: index, count: chunk.indices.length });
      vertex += chunk.vertexCount;
      index += chunk.indices.length;
    }
    gl.viewport(0, 0, width, height);
    gl.scissor(0, 0, width, height);
    gl.clearColor(0.05, 0.05, 0.06, 1);
    gl.clear(gl.COLOR_BUFFER_BIT);
    gl.uniform2f(this.size, width / frame.scale, height / frame.scale);
    gl.bufferData(gl.ARRAY_BUFFER, this.vertices.subarray(0, vertexCount * 20), gl.STREAM_DRAW);
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, this.indices.subarray(0, indexCount), gl.STREAM_DRAW);
    for (const run of runs) {
      const texture = this.textures.get(run.texture);
      if (!texture) continue;
      const [left, top, right, bottom] = run.clip.map((edge) => Math.round(edge * frame.scale));
      const [x, y] = [Math.max(left, 0), Math.max(top, 0)];
      const [w, h] = [Math.min(right, width) - x, Math.min(bottom, height) - y];
      if (w <= 0 || h <= 0) continue;
      gl.scissor(x, height - y - h, w, h);
      gl.bindTexture(gl.TEXTURE_2D, texture);
      gl.drawElements(gl.TRIANGLES, run.count, gl.UNSIGNED_INT, run.start * 4);
    }
  }
}

const COPY = 0x80000000;

async function inflated(bytes) {
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream('deflate-raw'));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

/// The chunks of the previous frame, with the changes.
function merged(before, list) {
  const view = new DataView(list.buffer, list.byteOffset, list.byteLength);
  const chunks = [];
  for (let at = 0; at < list.length;) {
    const entry = view.getUint32(at, true);
    at += 4;
    if (entry & COPY) {
      const start = view.getUint32(at, true);
      at += 4;
      for (let i = 0; i < (entry & ~COPY); i++) chunks.push(before[start + i]);
    } else {
      chunks.push(chunkOf(list.slice(at, at + entry)));
      at += entry;
    }
  }
  return chunks;
}

function chunkOf(bytes) {
  const view = new DataView(bytes.buffer);
  const clip = [0, 4, 8, 12].map((at) => view.getFloat32(at, true));
  const [texture, vertexCount, indexCount] = [16, 20, 24].map((at) => view.getUint32(at, true));
  const end = 28 + vertexCount * 20;
  const indices = vertexCount <= 65536 ? new Uint16Array(bytes.buffer, end, indexCount)
    : new Uint32Array(bytes.buffer, end, indexCount);
  return { clip, texture, vertexCount, vertices: bytes.subarray(28, end), indices };
}

/// The display of one connection after the other.
class Show {
  constructor(canvas) {
    this.painter = new Painter(canvas);
    this.forget(0);
  }

  /// A new connection: nothing was received of it yet.
  forget(connection) {
    this.connection = connection;
    this.chunks = [];
    this.waiting = Promise.resolve();
    for (const id of [...this.painter.textures.keys()]) this.painter.freeTexture(id);
  }

  /// Takes a message; messages are taken in order.
  take(message) {
    const { connection } = this;
    const is = () => connection === this.connection;
    this.waiting = this.waiting.then(() => (is() ? this.taken(message, is) : undefined)).catch((error) => {
      console.error(error);
      if (is()) postMessage({ connection, failed: String(error) });
    });
  }

  async taken(message, isCurrent) {
    const bytes = new Uint8Array(message);
    const headEnd = 4 + new DataView(message).getUint32(0, true);
    const head = JSON.parse(new TextDecoder().decode(bytes.subarray(4, headEnd)));
    let at = headEnd + head.chunks;
    const list = inflated(bytes.subarray(headEnd, at));
    const parts = head.textures.map((part) => {
      const data = bytes.subarray(at, at += part.bytes);
      const options = { premultiplyAlpha: 'none', colorSpaceConversion: 'none' };
      const pixels = part.jpeg ? createImageBitmap(new Blob([data], { type: 'image/jpeg' }), options) : inflated(data);
      return [part, pixels];
    });
    const chunks = merged(this.chunks, await list);
    for (const pair of parts) pair[1] = await pair[1];
    if (!isCurrent()) return;
    for (const [part, pixels] of parts) {
      this.painter.setTexture(part, pixels);
      pixels.close?.();
    }
    head.free.forEach((id) => this.painter.freeTexture(id));
    this.chunks = chunks;
    const { connection } = this;
    // A page that is not visible requests nothing more.
    requestAnimationFrame(() => {
      if (!isCurrent()) return;
      this.painter.paint({ chunks, size: head.size, scale: head.pixels_per_point });
      const { number, size, cursor, typing } = head;
      postMessage({ connection, number, size, cursor, typing });
    });
  }
}

let show;
onmessage = ({ data }) => {
  try {
    if (data.canvas) {
      show = new Show(data.canvas);
      data.canvas.addEventListener('webglcontextlost', () => postMessage({ lost: true }));
    } else if (data.frame) {
      show?.take(data.frame);
    } else {
      show?.forget(data.connection);
    }
  } catch (error) {
    postMessage({ lost: false, failed: String(error) });
  }
};
