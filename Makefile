# The two commands of a newcomer are `make run` and `make test`; everything else is for those who stay.
.PHONY: help run setup dev test sweep check fix bench soak storm fuzz pictures lock bundle sbom migration translations registers .browser
.DEFAULT_GOAL := help
SHELL  := /bin/bash
PYTHON ?= python3
VENV   ?= .venv
BIN    := $(VENV)/bin
export PATH := $(abspath $(BIN)):$(PATH)
# What Python has compiled is kept, or each of the hundreds of processes of the tests would do it again.
unexport PYTHONDONTWRITEBYTECODE
# The machine's own certificates count, so a site's authority does; then pip, uv and npm agree.
ifneq ($(wildcard /etc/ssl/certs/ca-certificates.crt),)
export UV_SYSTEM_CERTS ?= true
export NODE_EXTRA_CA_CERTS ?= /etc/ssl/certs/ca-certificates.crt
endif
# A site with a package mirror sets UV_INDEX_URL and PIP_INDEX_URL: uv does not read pip's configuration.
UVPIP  := $(BIN)/uv pip install -q --python $(BIN)/python
HASHED := --require-hashes --only-binary :all:

help: ## this list
	@awk -F ':.*## ' '/^[a-z]+:.*## / {printf "  make %-13s %s\n", $$1, $$2}' $(MAKEFILE_LIST)

run: setup ## set up what is missing, start the demo plant
	exec $(BIN)/pogon run $(ARGS)

setup: $(VENV)/.app static/vendor/.ready ## set up what is missing, start nothing

dev: setup ## the same as run, restarting on every change
	exec $(BIN)/watchfiles "$(BIN)/pogon run $(ARGS)" $(wildcard app templates plants migrations)

test: setup $(VENV)/.test ## the tests, of those that sweep a draw; T=tests/alarms all of a part, SEED=7 order and draw, ARGS=-x for pytest, JOBS=1 one after the other, TOGETHER=1 or 0 stages side by side or not
	$(BIN)/python tools/run_tests.py $(if $(SWEEP),--all) --seed "$(SEED)" --jobs "$(JOBS)" --browsers "$(BROWSERS)" $(if $(TOGETHER),$(if $(filter 0,$(TOGETHER)),--apart,--together)) $(T) -- $(ARGS)

sweep: ## every test, as the build server runs them; takes what test takes
	$(MAKE) test SWEEP=1

check: setup $(VENV)/.test ## format, lint, types, import rows, templates, languages
	$(BIN)/ruff format --check --quiet .
	$(BIN)/ruff check --quiet .
	$(BIN)/mypy --strict app tools
	$(BIN)/lint-imports
	$(BIN)/python tools/check_purity.py
	$(BIN)/python tools/check_house.py
	$(BIN)/python tools/check_texts.py
	$(BIN)/python tools/check_words.py

fix: $(VENV)/.test ## format and sort
	$(BIN)/ruff check --fix --quiet . ; $(BIN)/ruff format .

bench: setup $(VENV)/.test ## measure the numbers the design must not lose
	@[ -f tools/bench.py ] || { echo "tools/bench.py is not there yet: nothing to measure"; exit 1; }
	$(BIN)/python tools/bench.py $(ARGS)

soak: setup $(VENV)/.test .browser ## the tests that run for minutes, then HOURS=2 of use: memory, threads, files, sizes with slopes
	$(BIN)/python -m pytest -m soak --timeout 0 $(or $(T),tests) $(ARGS)
	$(BIN)/python tools/soak.py --hours "$(or $(HOURS),2)"

storm: setup $(VENV)/.test ## the whole house under people and faults in virtual time: SEEDS=1000, or SEED=7 MINUTES=60, PLANT=m1,c1
	$(BIN)/python -m tools.storm --seeds "$(or $(SEEDS),100)" --seed "$(SEED)" --minutes "$(or $(MINUTES),1)" --jobs "$(JOBS)" --plant "$(PLANT)" $(ARGS)

fuzz: setup $(VENV)/.test ## hostile values into every form, route and socket, at every plant: SEEDS=5, or SEED=7 PLANT=demo,own REQUESTS=500
	$(BIN)/python -m tools.fuzz --seeds "$(or $(SEEDS),5)" --seed "$(SEED)" --requests "$(or $(REQUESTS),500)" --jobs "$(JOBS)" --plant "$(PLANT)" $(ARGS)

pictures: setup $(VENV)/.test .browser ## photograph every screen into build/pictures
	@[ -f tools/pictures.py ] || { echo "tools/pictures.py is not there yet: no pictures to take"; exit 1; }
	$(BIN)/python tools/pictures.py $(ARGS)

lock: $(VENV)/.run ## resolve all versions anew into requirements/ and package-lock.json
	LOCK="$(BIN)/uv pip compile -q --universal --no-header --no-emit-index-url --no-annotate --generate-hashes --python-version 3.11 $(ARGS)"; \
	$$LOCK requirements/bootstrap.in -o requirements/bootstrap.lock && \
	$$LOCK pyproject.toml --group build -o requirements/run.lock && \
	$$LOCK pyproject.toml -c requirements/run.lock -o requirements/app.lock && \
	$$LOCK pyproject.toml --group build --group test -c requirements/run.lock -o requirements/test.lock
	npm install --package-lock-only --silent
	$(BIN)/python tools/npm_lock.py

bundle: setup ## what an offline machine of this Python and platform needs, into dist/bundle
	rm -rf dist/bundle && mkdir -p dist/bundle/wheels
	$(BIN)/uv build -q --wheel --no-build-isolation --python $(BIN)/python --out-dir dist/bundle .
	$(BIN)/python -m pip download -q $(HASHED) -r requirements/app.lock -d dist/bundle/wheels
	$(BIN)/python -c 'import sys, sysconfig; print(f"python{sys.version_info[0]}.{sys.version_info[1]} {sysconfig.get_platform()}")' > dist/bundle/platform
	cp requirements/app.lock packaging/install.sh packaging/pogon.service LICENSE dist/bundle/

sbom: setup $(VENV)/.test ## the software bill of materials (CycloneDX) of what runs, into dist
	$(BIN)/python tools/sbom.py dist/pogon.cdx.json

migration: setup ## new Alembic revision; M="what changes"
	@[ -n "$(M)" ] || { echo 'say what changes: make migration M="alarms get a shelf"'; exit 1; }
	$(BIN)/alembic -c migrations/alembic.ini $(ARGS) revision --autogenerate -m "$(M)"

translations: $(VENV)/.test ## collect texts; each language gets a new.toml of what it lacks
	$(BIN)/python tools/check_texts.py --update

registers: $(VENV)/.test ## describe the register maps of our machines in docs/registers, and as PLC text in docs/plc
	$(BIN)/python tools/registers.py
	$(BIN)/python tools/plc_text.py

# Stamps: each is redone when what it was made from changes.
$(VENV)/.run: requirements/bootstrap.lock requirements/run.lock
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null || \
	  { echo "Pogon needs Python 3.11 or newer, not '$$($(PYTHON) -V 2>&1)': make PYTHON=python3.12 ..."; exit 1; }
	@$(PYTHON) -c 'import venv, ensurepip' 2>/dev/null || \
	  { echo "This Python cannot make environments: apt-get install python3-venv"; exit 1; }
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install -q --disable-pip-version-check $(HASHED) -r requirements/bootstrap.lock
	$(UVPIP) $(HASHED) -r requirements/run.lock
	@touch $@

$(VENV)/.app: $(VENV)/.run pyproject.toml
	$(UVPIP) --no-deps --no-build-isolation -e .
	@touch $@

$(VENV)/.test: $(VENV)/.run requirements/test.lock
	$(UVPIP) $(HASHED) -r requirements/test.lock
	@touch $@

static/vendor/.ready: package-lock.json tools/assets.py | $(VENV)/.run
	$(BIN)/python tools/assets.py
	@touch $@

.browser:
	@command -v "$${POGON_CHROMIUM:-chromium-headless-shell}" >/dev/null || { [ -z "$$POGON_CHROMIUM" ] && command -v chromium >/dev/null; } && exit 0; \
	if [ "$$(id -u)" = 0 ] && command -v apt-get >/dev/null; then \
	  install() { DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "$$1" >/dev/null; }; \
	  apt-get update -qq && { install chromium-headless-shell 2>/dev/null || install chromium; }; \
	else echo 'The browser tests need Chromium (chromium-headless-shell is enough): install it, or name it in POGON_CHROMIUM, or leave them out: make check && $(BIN)/python -m pytest -m "not browser"'; exit 1; fi
