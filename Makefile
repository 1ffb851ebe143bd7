# Two commands to know: `make demo` and `make test`. Both set up what they need.

CARGO ?= cargo
OUT ?= out

# Where cargo puts programs, and those that are not optimised for release.
TARGET := $(or $(CARGO_TARGET_DIR),target)
BUILT := $(TARGET)/debug

.PHONY: test-demo setup-tests setup-fuzz header reference plugins setup demo install install-c test test-long fuzz format lint bench tradeoff train evaluate pictures live-pictures clean

# Installs what is missing where it may, else says the exact line.
setup:
	@sh scripts/setup.sh

# And the servers and the browser that tests drive.
setup-tests:
	@sh scripts/setup.sh tests

# And what fuzzing needs.
setup-fuzz: setup
	@sh scripts/setup.sh fuzz

# Renders the default stroke over the default material: WAV, plot and report; and the paper's chain over the same
# stroke, to compare. The program is one without tract, which would take as long to build as all the rest: it refuses
# networks that are no plain multilayer perceptron, and pictures.
demo: setup
	$(CARGO) build --profile demo -p asperity --no-default-features
	mkdir -p $(OUT)
	$(TARGET)/demo/asperity render graphs/texture.ron --out $(OUT)/demo.wav --plot $(OUT)/demo.svg --report $(OUT)/demo.json
	$(TARGET)/demo/asperity render graphs/heravi2024.ron --out $(OUT)/paper.wav --quiet
	@echo
	@echo "listen to  $(OUT)/demo.wav   a stroke over canvas: the signal for the actuator, by graphs/texture.ron"
	@echo "compare    $(OUT)/paper.wav  the same stroke by the paper's chain, graphs/heravi2024.ron: it repeats itself"
	@echo "look at    $(OUT)/demo.svg   position, speed, force, acceleration, spectrogram and current over time"
	@echo "read       $(OUT)/demo.json  how long a tick took, the level, and what each node did"

# Installs the program with its manual pages and shell completions.
PREFIX ?= $(HOME)/.local
SHARE := $(PREFIX)/share
install: setup
	$(CARGO) install --locked --path hosts/cli --root $(PREFIX)
	$(PREFIX)/bin/asperity man --out $(SHARE)/man/man1
	mkdir -p $(SHARE)/bash-completion/completions $(SHARE)/zsh/site-functions $(SHARE)/fish/vendor_completions.d
	$(PREFIX)/bin/asperity completions bash > $(SHARE)/bash-completion/completions/asperity
	$(PREFIX)/bin/asperity completions zsh > $(SHARE)/zsh/site-functions/_asperity
	$(PREFIX)/bin/asperity completions fish > $(SHARE)/fish/vendor_completions.d/asperity.fish

# Installs the C library with its header, and the files of pkg-config and CMake.
install-c: setup
	$(CARGO) build --release --locked -p asperity-capi
	sh scripts/capi.sh install $(PREFIX) $(firstword $(wildcard $(TARGET)/release/libasperity.so) $(TARGET)/release/libasperity.dylib)

# Every test but the long ones. Those of the training are left out, since its framework takes long to build; with
# `make test WITHOUT=` they run too. `BUILD=--all-targets` also builds the benches.
WITHOUT ?= --exclude asperity-train
BUILD ?=
test: setup-tests
	$(CARGO) test --workspace $(WITHOUT) $(BUILD) --no-run
	$(CARGO) test --workspace $(WITHOUT) --no-fail-fast
	CARGO="$(CARGO)" sh scripts/python.sh $(WITHOUT)
	CARGO="$(CARGO)" sh scripts/capi.sh $(WITHOUT)

# The program without tract renders the same bytes as the whole one, and says what it refuses. Both are built with the
# features of the whole workspace, so that `make test` has built all but the program itself.
test-demo: setup
	mkdir -p $(OUT)
	$(CARGO) build --workspace $(WITHOUT) --bin asperity
	cp $(BUILT)/asperity $(OUT)/whole
	$(CARGO) build --workspace $(WITHOUT) --no-default-features --bin asperity
	cp $(BUILT)/asperity $(OUT)/plain
	for program in whole plain; do \
	    $(OUT)/$$program render graphs/texture.ron --seconds 2 --out $(OUT)/$$program.wav || exit 1; done
	cmp $(OUT)/whole.wav $(OUT)/plain.wav
	! $(OUT)/plain check graphs/texture.ron --set texture.executor=tract 2> $(OUT)/plain.txt
	grep 'cargo install' $(OUT)/plain.txt

# The tests that take minutes, and some hours for the hard cases: a million ticks without an allocation, a thousand
# swaps of the shipped graph, a million ticks live, ten million ticks of nodes that fail, sixty times as many hostile
# cases, every reader fuzzed for a minute, Python's package as a wheel, and the C programs under valgrind.
test-long: setup-tests setup-fuzz
	ASPERITY_LONG_TICKS=1000000 $(CARGO) test -p asperity --test alloc ticks::
	ASPERITY_LONG_SWAPS=1000 PROPTEST_CASES=5000 $(CARGO) test -p asperity --test alloc swap_long::
	ASPERITY_LONG_TICKS=1000000 $(CARGO) test -p asperity --test live long:: -- --nocapture
	ASPERITY_STABILITY=long ASPERITY_LONG_TICKS=10000000 PROPTEST_CASES=2000 \
	    $(CARGO) test -p asperity --test stability -- --nocapture
	ASPERITY_HOSTILE=180 $(CARGO) test -p asperity --test it hostile:: -- --nocapture
	CARGO="$(CARGO)" sh scripts/fuzz.sh 60
	sh scripts/python.sh wheel
	sh scripts/capi.sh long

# Every reader, for so many seconds each.
FUZZ_S ?= 600
fuzz: setup-fuzz
	CARGO="$(CARGO)" sh scripts/fuzz.sh $(FUZZ_S)

# Looks at the code without building it.
format: setup
	$(CARGO) fmt --all --check
	sh scripts/words.sh

lint: format
	$(CARGO) clippy --workspace --all-targets -- -D warnings

# One table: each node and the whole tick, beside a plain read of the network's weights.
bench: setup
	$(CARGO) bench -p asperity --bench tick --bench swap --bench scene

# Builds the shipped plugins: more phase-retrieval nodes.
plugins: setup
	$(CARGO) build --release -p asperity-rtpghi -p asperity-gsrtisi-la
	mkdir -p $(OUT)/plugins
	cp $(TARGET)/release/librtpghi.* $(TARGET)/release/libgsrtisi_la.* $(OUT)/plugins/
	rm -f $(OUT)/plugins/*.d $(OUT)/plugins/*.rlib
	@echo
	@echo "to have them in every graph and in compare:"
	@echo "    export ASPERITY_PLUGIN_PATH=$(abspath $(OUT)/plugins)"

# What accuracy costs in time: the shipped trade-off. Under 15 minutes on 2 cores; a stopped run resumes.
# The report and pictures go to docs/tradeoff, the results that `asperity choose` has to graphs/tradeoffs.
tradeoff: setup
	$(CARGO) build --release -p asperity -p asperity-rtpghi -p asperity-gsrtisi-la
	mkdir -p $(OUT)
	$(TARGET)/release/asperity tradeoff graphs/tradeoffs/shipped.ron --out $(OUT)/tradeoff --jobs 2 \
	    --plugin $(TARGET)/release/librtpghi.so --plugin $(TARGET)/release/libgsrtisi_la.so
	cp $(OUT)/tradeoff/*.svg $(OUT)/tradeoff/results.csv $(OUT)/tradeoff/REPORT.md docs/tradeoff/
	cp $(OUT)/tradeoff/results.json graphs/tradeoffs/

# Writes the C headers anew from their Rust: the plugin interface's and the C library's.
header: setup
	ASPERITY_WRITE_HEADER=1 $(CARGO) test -p asperity-abi -p asperity-capi header

# Writes the generated parts of docs/reference anew.
reference: setup
	$(CARGO) build --workspace $(WITHOUT) --bin asperity
	$(BUILT)/asperity reference

# Trains the model of the made surfaces again; checkpoints lie in $(OUT).
train: setup
	mkdir -p $(OUT)
	$(CARGO) run --release -p asperity-train -- train --out graphs/models/surfaces --run $(OUT)/surfaces.run

# Judges it again, and writes its card anew.
evaluate: setup
	$(CARGO) run --release -p asperity-train -- evaluate graphs/models/surfaces --run $(OUT)/surfaces.run

# The pictures of the README and of docs/. The tests of tests/it/pictures.rs fail when one is stale.
pictures: setup
	$(CARGO) build --release -p asperity
	$(TARGET)/release/asperity graph graphs/texture.ron --svg docs/graph.svg
	$(TARGET)/release/asperity render graphs/texture.ron --plot docs/render.svg
	$(TARGET)/release/asperity render graphs/scenes/every_effect.ron --plot docs/scene.svg
	$(CARGO) build --release -p asperity-rtpghi -p asperity-gsrtisi-la
	$(TARGET)/release/asperity compare --plugin $(TARGET)/release/librtpghi.so \
	    --plugin $(TARGET)/release/libgsrtisi_la.so --phase sample_commit:emission=0 --svg docs/compare.svg
	mkdir -p $(OUT)
	$(TARGET)/release/asperity calibrate \
	    --device simulated:plant=hapcoil_one,plant_handle_g=60,plant_noise=0.3,latency=431 \
	    --handle-mass-g 60 --accelerometer-full-scale 100 --out $(OUT)/found.ron --plot docs/calibrate.svg
	$(CARGO) bench --profile release -p asperity --bench rhythm -- --svg $(abspath docs)/pulses.svg
	ASPERITY_PICTURES=$(abspath docs) $(CARGO) test --workspace $(WITHOUT) --test it -- \
	    picture_of_a_fit study_of_the_docs

# And that of a run: the page in a browser while a pen strokes.
live-pictures: setup-tests
	ASPERITY_PICTURES=$(abspath docs) $(CARGO) test --workspace $(WITHOUT) --test live pictures::

clean:
	$(CARGO) clean
	rm -rf $(OUT)
