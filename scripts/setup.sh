# Sourced by ./run, ./test and scripts/package: makes sure that the system packages and the Rust toolchain are there.
# Says what it is about to install and why; does nothing, and needs no network, when everything is there already.

say() { printf '%s\n' "$*" >&2; }

as_root() {
  if [ "$(id -u)" -eq 0 ]; then "$@"
  elif command -v sudo >/dev/null 2>&1; then sudo "$@"
  else
    say "This needs root and there is no sudo. As root, run:  $*"
    return 1
  fi
}

# package : why, one per line
system_packages() {
  cat <<'PACKAGES'
g++ : compiles the bundled ZeroMQ library
pkg-config : finds OpenCV
libopencv-dev : board detection and intrinsics
clang : reads OpenCV's headers for the Rust bindings
libclang-dev : reads OpenCV's headers for the Rust bindings
libxkbcommon-x11-0 : keyboard of the window
libxcursor1 : pointer of the window
libxi6 : pointer of the window
libgl1 : drawing of the window
libegl1 : drawing of the window
libgl1-mesa-dri : drawing of the window without a graphics card
PACKAGES
  [ "${HANDEYE_SETUP_FOR:-run}" = test ] && cat <<'PACKAGES'
python3 : the official CoppeliaSim client is tested against the cell
python3-venv : the official CoppeliaSim client is tested against the cell
mesa-vulkan-drivers : images of the window in the tests
xvfb : the window is driven by a real mouse in the tests
xdotool : the window is driven by a real mouse in the tests
imagemagick : the window is driven by a real mouse in the tests
chromium : the recording is looked at in a browser in the tests
PACKAGES
  [ "${HANDEYE_SETUP_FOR:-run}" = package ] && cat <<'PACKAGES'
binutils : the versions of the system's symbols that a package needs
cmake : builds OpenCV to be linked in
debian-archive-keyring : checks OpenCV's sources
ninja-build : builds OpenCV to be linked in
python3 : lists licences, builds the module
python3-venv : builds the module
zlib1g-dev : linked in, for OpenCV
zstd : compresses the package
PACKAGES
  return 0
}

is_installed() { dpkg-query -W -f='${Status}' "$1" 2>/dev/null | grep -q '^install ok installed$'; }

install_system_packages() {
  if ! command -v apt-get >/dev/null 2>&1; then
    if pkg-config --exists opencv4 2>/dev/null && command -v c++ >/dev/null 2>&1; then return 0; fi
    say "This machine has no apt. Install the counterparts of these Debian packages with your package manager, then run again:"
    system_packages >&2
    return 1
  fi
  local missing=() line package
  while IFS= read -r line; do
    package=${line%% : *}
    case $package in
      # A Python that brings its own venv serves as well as Debian's.
      python3|python3-venv) python3 -c 'import venv, ensurepip' 2>/dev/null && continue ;;
    esac
    is_installed "$package" || { missing+=("$package"); say "  $line"; }
  done < <(system_packages)
  [ ${#missing[@]} -eq 0 ] && return 0
  say "The packages above are missing and are installed now with apt-get."
  as_root env DEBIAN_FRONTEND=noninteractive apt-get update -qq || say "apt-get update failed; trying with the lists at hand."
  as_root env DEBIAN_FRONTEND=noninteractive apt-get install -y -q --no-install-recommends "${missing[@]}" >&2 || {
    say "apt-get could not install: ${missing[*]}"
    return 1
  }
}

install_rust() {
  command -v cargo >/dev/null 2>&1 && return 0
  [ -f "$HOME/.cargo/env" ] && . "$HOME/.cargo/env"
  command -v cargo >/dev/null 2>&1 && return 0
  say "There is no Rust toolchain. rustup, Rust's own installer, is fetched from https://sh.rustup.rs into ~/.cargo now."
  command -v curl >/dev/null 2>&1 || as_root apt-get install -y -qq --no-install-recommends curl ca-certificates >&2 || return 1
  curl --proto '=https' --tlsv1.2 -sSf https://sh.rustup.rs | sh -s -- -y --profile minimal --default-toolchain none >&2 || {
    say "rustup could not be installed. See https://rustup.rs, then run again."
    return 1
  }
  . "$HOME/.cargo/env"
}

set_up() { install_system_packages && install_rust; }
