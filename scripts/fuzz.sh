#!/bin/sh
# Fuzzes what reads files, so many seconds each: scripts/fuzz.sh SECONDS [TARGET...]
#
# A target begins with fuzz/corpus/TARGET; what it finds beyond stays in fuzz/found. An input that makes it fail is put into fuzz/artifacts,
# and ends the script. A failure is a panic, more than 20 s (TIMEOUT_S) for one input, or more memory than tests/stability/readers.rs says (which the target counts
# itself); the whole process may have 2 GiB, and a single allocation 1 GiB where there is a sanitizer to look after it.
#
# Needs no nightly compiler. With one, SANITIZER=address CARGO="cargo +nightly" looks for errors of memory too, two to three times slower.
set -eu

seconds=${1:?say for how many seconds}
shift
cargo=${CARGO:-cargo}
cd "$(dirname "$0")/../fuzz"
[ $# -gt 0 ] || set -- $(sed -n 's/^name = "\(.*\)"/\1/p' Cargo.toml | grep -v asperity)
for target in "$@"; do
    mkdir -p "found/$target"
    $cargo fuzz run --sanitizer "${SANITIZER:-none}" "$target" "found/$target" "corpus/$target" -- \
        -max_total_time="$seconds" -timeout="${TIMEOUT_S:-20}" -rss_limit_mb=2048 -malloc_limit_mb=1024 -max_len=65536 -dict=words.dict \
        -print_final_stats=1 -verbosity=0
    echo "$target: nothing found in $seconds s"
done
