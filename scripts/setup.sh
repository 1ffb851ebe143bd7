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

if [ -n "$missing" ]; then
    line="apt-get install -y$missing"
    if ! command -v apt-get >/dev/null 2>&1; then
        echo "missing:$missing (Debian's names). Install them with this system's package manager, then try again." >&2
        exit 1
    elif [ "$(id -u)" = 0 ]; then
        apt-get update -q && $line
    elif command -v sudo >/dev/null 2>&1 && sudo -n true 2>/dev/null; then
        sudo apt-get update -q && sudo $line
    else
        echo "missing:$missing. Run this, then try again:" >&2
        echo "    sudo $line" >&2
        exit 1
    fi
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
