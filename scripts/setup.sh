#!/bin/sh
# Checks for what a build needs; installs system packages where it may, else says the exact line.
set -eu

missing=""
command -v cc >/dev/null 2>&1 || missing="$missing build-essential"
command -v pkg-config >/dev/null 2>&1 || missing="$missing pkg-config"
# ALSA's library is linked. JACK's is opened at run time, and PulseAudio's protocol is spoken without one.
if [ "$(uname)" = Linux ]; then
    pkg-config --exists alsa 2>/dev/null || missing="$missing libasound2-dev"
fi

# Installs Debian packages where that may be done; else answers false.
install() {
    command -v apt-get >/dev/null 2>&1 || return 1
    if [ "$(id -u)" = 0 ]; then
        as_root=""
    elif command -v sudo >/dev/null 2>&1 && sudo -n true 2>/dev/null; then
        as_root="sudo"
    else
        return 1
    fi
    $as_root apt-get update -q && $as_root env DEBIAN_FRONTEND=noninteractive apt-get install -y --no-install-recommends "$@"
}

if [ -n "$missing" ]; then
    install $missing || {
        echo "missing:$missing (Debian's names). Install them, then try again:" >&2
        echo "    sudo apt-get install -y$missing" >&2
        exit 1
    }
fi

# Servers, a browser and an emulator that tests drive. Without them these tests say that they are skipped.
if [ "${1:-}" = tests ] && [ "$(uname)" = Linux ]; then
    drive=""
    command -v jackd >/dev/null 2>&1 || drive="$drive jackd2"
    command -v pulseaudio >/dev/null 2>&1 || drive="$drive pulseaudio"
    command -v parec >/dev/null 2>&1 || drive="$drive pulseaudio-utils"
    command -v pulseaudio >/dev/null 2>&1 && ls /usr/lib/*/alsa-lib/libasound_module_pcm_pulse.so >/dev/null 2>&1 || drive="$drive libasound2-plugins"
    command -v chromium >/dev/null 2>&1 || command -v google-chrome >/dev/null 2>&1 || drive="$drive chromium"
    python3 -c 'import ensurepip, venv' >/dev/null 2>&1 || drive="$drive python3-venv"
    # Emulates a CPU without vector instructions.
    command -v qemu-x86_64 >/dev/null 2>&1 || drive="$drive qemu-user"
    if [ -n "$drive" ]; then
        install $drive || echo "not installed:$drive; the tests that need them are skipped" >&2
    fi
    # Finds faults of the page's accessibility. It is under another licence (MPL-2.0), so it is not kept here.
    axe=4.14.1
    sum="29348999450cdf2849a8e70b7912fc2da85a849da39c0d0d5394f51d4a9ed95c  target/axe/axe.min.js"
    has_axe() { echo "$sum" | sha256sum --check --status 2>/dev/null; }
    if ! has_axe; then
        mkdir -p target/axe
        (cd target/axe && npm pack --silent "axe-core@$axe" && tar -xzf "axe-core-$axe.tgz" --strip-components 1 package/axe.min.js) >/dev/null 2>&1 || true
        has_axe || { rm -rf target/axe; echo "not installed: axe-core $axe, by npm; the test that needs it is skipped" >&2; }
    fi
fi

# What fuzzing needs beside a compiler for C++.
if [ "${1:-}" = fuzz ]; then
    command -v c++ >/dev/null 2>&1 || install g++ || {
        echo "missing: a compiler for C++. Install it, then try again: sudo apt-get install -y g++" >&2
        exit 1
    }
    cargo fuzz --version >/dev/null 2>&1 || cargo install --locked cargo-fuzz || {
        echo "missing: cargo-fuzz. Install it, then try again: cargo install --locked cargo-fuzz" >&2
        exit 1
    }
fi

if ! command -v cargo >/dev/null 2>&1; then
    echo "Rust is missing. Get it from https://rustup.rs, or with: sudo apt-get install -y rustup && rustup default stable" >&2
    exit 1
fi

# The edition and library features used need this version.
needed=95
minor=$(rustc --version | sed -E 's/^rustc 1\.([0-9]+)\..*/\1/')
case "$minor" in
    *[!0-9]*) ;;
    *) if [ "$minor" -lt "$needed" ]; then
           echo "Rust 1.$needed or later is needed; this is $(rustc --version). Run: rustup update stable" >&2
           exit 1
       fi ;;
esac
