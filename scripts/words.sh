#!/bin/sh
# Lines of Rust end before column 111, doc comments do not begin with "What", and names of tests have at most
# 60 characters. README.md has at most 180 lines, ARCHITECTURE.md 150. Prints what does not hold.
set -eu
cd "$(dirname "$0")/.."
export LC_ALL=C.UTF-8
found=$(
    wc -l README.md ARCHITECTURE.md | awk '
        $2 == "README.md" && $1 > 180 || $2 == "ARCHITECTURE.md" && $1 > 150 { print $2 ": " $1 " lines" }'
    git ls-files '*.rs' | xargs grep -nE '^.{111,}$' | sed 's/^\([^:]*:[0-9]*\):.*/\1: longer than 110 columns/'
    git ls-files '*.rs' | xargs grep -nE '//[/!] What ' | sed 's/^\([^:]*:[0-9]*\):.*/\1: a doc begins with "What"/'
    git ls-files '*.rs' | xargs awk '
        /#\[test\]/ { test = 4 }
        test > 0 && match($0, /fn [a-z0-9_]+\(/) {
            if (RLENGTH - 4 > 60) print FILENAME ":" FNR ": the name of a test is longer than 60 characters"
            test = 0
        }
        { test-- }'
) || true
if [ -n "$found" ]; then
    echo "$found"
    exit 1
fi
