#!/bin/sh
# Tests the Python package: pytest, and mypy in strict mode. The virtual environment is target/python. Says why it
# tests nothing where Python 3.10 or the package index is missing.
#     sh scripts/python.sh [options of `cargo build --workspace`]    with the library of cargo's own build
#     sh scripts/python.sh wheel                                     with a wheel, as pip makes it
set -eu
cd "$(dirname "$0")/.."
target=$(cd "$(dirname "${CARGO_TARGET_DIR:-target}")" && pwd)/$(basename "${CARGO_TARGET_DIR:-target}")
venv=$target/python
skip() {
    echo "the Python package is not tested: $1"
    exit 0
}
python3 -c 'import sys; sys.exit(sys.version_info < (3, 10))' 2>/dev/null || skip "there is no Python 3.10 or later"
[ -x "$venv/bin/pip" ] || python3 -m venv "$venv" 2>/dev/null || skip "there is no python3-venv"
tools="maturin numpy pytest mypy matplotlib pandas"
"$venv/bin/python" -c "import $(echo $tools | tr ' ' ,)" 2>/dev/null ||
    "$venv/bin/pip" install --quiet --disable-pip-version-check $tools ||
    skip "the package index does not give $tools"

if [ "${1:-}" = wheel ]; then
    rm -rf "$target/wheels"
    "$venv/bin/maturin" build --quiet --locked --release --manifest-path hosts/python/Cargo.toml \
        --interpreter "$venv/bin/python" --out "$target/wheels"
    ls -l "$target"/wheels/*.whl
    "$venv/bin/pip" install --quiet --disable-pip-version-check --no-deps --force-reinstall "$target"/wheels/*.whl
else
    # Of the same packages as cargo's tests, so that hardly anything is built twice.
    ${CARGO:-cargo} build --workspace "$@" --lib
    package=$target/python-package
    rm -rf "$package"
    cp -R hosts/python/python "$package"
    cp "$target"/debug/libasperity_python.so "$package/asperity/_asperity.abi3.so" 2>/dev/null ||
        cp "$target"/debug/libasperity_python.dylib "$package/asperity/_asperity.abi3.so"
    export PYTHONPATH="$package"
fi

export ASPERITY_PROGRAM="${ASPERITY_PROGRAM:-$target/debug/asperity}"
[ -x "$ASPERITY_PROGRAM" ] || unset ASPERITY_PROGRAM
cd hosts/python
MYPYPATH=python:tests "$venv/bin/mypy" --cache-dir "$target/mypy" python/asperity tests
"$venv/bin/pytest" -q -p no:cacheprovider -rs
