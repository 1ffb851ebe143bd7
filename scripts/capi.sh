#!/bin/sh
# Builds and runs the programs of hosts/capi against the C library, and compares samples with `asperity render`.
# Names each part that it leaves out, where a tool is missing.
#     sh scripts/capi.sh [options of `cargo build --workspace`]    with the library of cargo's own build
#     sh scripts/capi.sh long [MINUTES]                            under valgrind, 10 minutes in all
#     sh scripts/capi.sh install PREFIX LIBRARY                    only installs this libasperity
set -eu
cd "$(dirname "$0")/.."
capi=$PWD/hosts/capi
version=$(sed -n 's/^version = "\(.*\)"/\1/p' Cargo.toml | head -1)
major=${version%%.*}
minor=${version#*.}
minor=${minor%%.*}
interface=$major
[ "$major" != 0 ] || interface=0.$minor

# Installs a library, its header, and the files of pkg-config and CMake.
install_to() {
    mkdir -p "$1/lib/pkgconfig" "$1/lib/cmake/asperity" "$1/include"
    case $2 in
        *.dylib) cp "$2" "$1/lib/libasperity.dylib" ;;
        *)
            cp "$2" "$1/lib/libasperity.so.$version"
            ln -sf "libasperity.so.$version" "$1/lib/libasperity.so.$interface"
            ln -sf "libasperity.so.$interface" "$1/lib/libasperity.so"
            ;;
    esac
    cp "$capi/include/asperity.h" "$1/include/"
    cp "$capi/asperity-config.cmake" "$1/lib/cmake/asperity/"
    fill="s/@VERSION@/$version/; s/@MAJOR@/$major/; s/@MINOR@/$minor/"
    sed "$fill" "$capi/asperity.pc.in" > "$1/lib/pkgconfig/asperity.pc"
    sed "$fill" "$capi/asperity-config-version.cmake.in" > "$1/lib/cmake/asperity/asperity-config-version.cmake"
}

if [ "${1:-}" = install ]; then
    install_to "$2" "$3"
    exit 0
fi

target=$(cd "$(dirname "${CARGO_TARGET_DIR:-target}")" && pwd)/$(basename "${CARGO_TARGET_DIR:-target}")
long=""
if [ "${1:-}" = long ]; then
    long=${2:-10}
else
    # Of the same packages as cargo's tests, so that hardly anything is built twice.
    ${CARGO:-cargo} build --workspace "$@" --lib
fi
library=$target/debug/libasperity.so
[ -f "$library" ] || library=$target/debug/libasperity.dylib

home=$target/capi
rm -rf "$home"
install_to "$home" "$library"
export PKG_CONFIG_PATH="$home/lib/pkgconfig" LD_LIBRARY_PATH="$home/lib" DYLD_LIBRARY_PATH="$home/lib"
bin=$home/bin
out=$home/out
mkdir -p "$bin" "$out"
graphs=$PWD/graphs

left_out() { echo "left out: $1"; }
has() { command -v "$1" >/dev/null 2>&1; }
strict="-Wall -Wextra -pedantic -Werror -O1 -g"
c() { # NAME SOURCE LIBRARIES
    cc -std=c11 $strict "$2" -o "$bin/$1" $(pkg-config --cflags --libs asperity) ${3:-} -lm -pthread
}
cpp() {
    c++ -std=c++17 $strict "$2" -o "$bin/$1" $(pkg-config --cflags --libs asperity) -pthread
}

for tool in cc c++ pkg-config; do
    has $tool || { left_out "all programs in C and C++, without $tool"; exit 0; }
done
cc -std=c11 $strict -fsyntax-only -x c "$capi/include/asperity.h"
c++ -std=c++17 $strict -fsyntax-only -x c++ "$capi/include/asperity.h"
[ "$(pkg-config --modversion asperity)" = "$version" ]
c render "$capi/examples/render.c"
c wrong "$capi/tests/wrong.c"
cpp servo "$capi/examples/servo.cpp"

if [ -n "$long" ]; then
    has valgrind || { left_out "valgrind, which is not installed"; exit 0; }
    share=$((long * 60 / 2))
    for tool in memcheck helgrind; do
        began=$(date +%s) seed=0
        check="valgrind --quiet --error-exitcode=9 --suppressions=$capi/tests/valgrind.supp --tool=$tool"
        while [ $(($(date +%s) - began)) -lt $share ]; do
            seed=$((seed + 1))
            $check "$bin/wrong" "$graphs/texture.ron" $((seed + 2)) 60
            $check "$bin/servo" "$graphs/haply.ron" 2
            [ $seed != 1 ] || $check "$bin/render" "$graphs/texture.ron" hand "$out/$tool.f32"
        done
        echo "valgrind $tool: $seed rounds, no finding"
    done
    exit 0
fi

# The same samples by the program and by C: the graph's own stroke, and a recorded one.
program=${ASPERITY_PROGRAM:-$target/debug/asperity}
if [ -x "$program" ]; then
    "$bin/render" "$graphs/texture.ron" - "$out/own.f32"
    "$program" render "$graphs/texture.ron" --out "$out/own.npy" --quiet
    stroke=$graphs/trajectories/zigzag.csv
    "$bin/render" "$graphs/heravi2024.ron" "$stroke" "$out/recorded.f32"
    "$program" render "$graphs/heravi2024.ron" --input "$stroke" --out "$out/recorded.npy" --quiet
    for name in own recorded; do
        # A .npy file has a head before the same numbers.
        size=$(wc -c < "$out/$name.f32")
        [ "$size" -gt 100000 ]
        tail -c "$size" "$out/$name.npy" | cmp - "$out/$name.f32"
    done
    echo "the same samples by asperity render and by C"
else
    left_out "the comparison with asperity render: $program is not built"
fi

"$bin/servo" "$graphs/haply.ron" 2
"$bin/wrong" "$graphs/texture.ron" 1 1500

# The example of the page.
awk '/^```c$/ { on = 1; next } /^```/ { on = 0 } on' docs/c.md > "$out/page.c"
c page "$out/page.c"
"$bin/page"

if has cmake; then
    cmake -S "$capi/examples" -B "$home/cmake" -DCMAKE_PREFIX_PATH="$home" > "$out/cmake.txt"
    cmake --build "$home/cmake" >> "$out/cmake.txt"
    "$home/cmake/render" "$graphs/texture.ron" hand "$out/hand.f32"
else
    left_out "CMake, which is not installed"
    "$bin/render" "$graphs/texture.ron" hand "$out/hand.f32"
fi

if has mcs && has mono; then
    mcs -out:"$bin/Asperity.exe" "$capi/examples/Asperity.cs"
    mono "$bin/Asperity.exe" "$graphs/texture.ron" "$out/csharp.f32"
    cmp "$out/hand.f32" "$out/csharp.f32"
    echo "the same samples by C#"
else
    left_out "C#, without mcs and mono (Debian: mono-mcs mono-runtime)"
fi

if has mkoctfile && has octave-cli; then
    (cd "$bin" && mkoctfile --mex "$capi/examples/asperity_render.c" -I"$home/include" -L"$home/lib" -lasperity)
    octave-cli --no-gui --quiet --path "$bin" "$capi/examples/render.m" "$graphs/texture.ron" "$out/octave.f32"
    cmp "$out/hand.f32" "$out/octave.f32"
    echo "the same samples by Octave"
else
    left_out "Octave, without octave-cli and mkoctfile (Debian: octave-dev)"
fi

if pkg-config --exists jack && has jackd; then
    c pull_jack "$capi/examples/pull_jack.c" "$(pkg-config --libs jack)"
    export JACK_DEFAULT_SERVER="asperity-capi-$$"
    jackd --no-realtime --name "$JACK_DEFAULT_SERVER" -d dummy -r 44100 -p 128 > "$out/jackd.txt" 2>&1 &
    server=$!
    trap 'kill $server 2>/dev/null || true' EXIT
    if has jack_wait; then jack_wait -w -t 30 > /dev/null; else sleep 5; fi
    "$bin/pull_jack" "$graphs/live.ron" 3
else
    left_out "JACK, without jackd and its header (Debian: jackd2 libjack-jackd2-dev)"
fi
