# Two commands matter: `make demo` and `make test`. Both set the project up on a bare machine first.
PYTHON ?= python3
SERVE ?= 1
VENV := .venv
BIN := $(VENV)/bin

.PHONY: demo test warm setup system lint types web-types unit lock catalogues

setup: $(VENV)/.ready

$(VENV)/.ready: pyproject.toml requirements.lock
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' \
	  || { echo "scancell needs Python 3.11 or newer; $(PYTHON) is older. Try: make PYTHON=python3.12 $(MAKECMDGOALS)"; exit 2; }
	@test -x $(BIN)/python || $(PYTHON) -m venv $(VENV) \
	  || { echo "python3 -m venv failed; on Debian: apt-get install python3-venv"; exit 2; }
	$(BIN)/python -m pip install --quiet --require-hashes --requirement requirements.lock
	$(BIN)/python -m pip install --quiet --no-deps --no-build-isolation --editable .
	@touch $@

system:
	@sh .ci/system-packages

demo: system setup warm
	$(BIN)/scancell demo $(if $(filter 0,$(SERVE)),--no-serve,)

warm: setup
	$(BIN)/scancell warm

test: system setup
	$(MAKE) --jobs 2 --output-sync=target warm types lint web-types  # two at a time: the kernels are compiled meanwhile
	$(MAKE) unit

lint: setup
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

types: setup
	$(BIN)/pyright

web-types: setup
	$(BIN)/python tests/web/check_types.py

# A test that fails beside others is run once more, alone: what passes then depends on time, and is told as that.
unit: setup
	@$(BIN)/python -m pytest -n 4 --dist worksteal --durations=25; code=$$?; \
	if [ $$code -ne 1 ]; then exit $$code; fi; \
	echo "The tests above failed beside others. Each is run once more, alone; one that passes now depends on time: mend it."; \
	$(BIN)/python -m pytest --last-failed --last-failed-no-failures none

catalogues: setup
	$(BIN)/python -m tests.catalogues

lock: setup
	$(BIN)/python -m pip install --quiet uv
	$(BIN)/uv pip compile pyproject.toml --all-extras --group dev --group build --universal --python-version 3.11 --generate-hashes --no-header --output-file requirements.lock
	$(BIN)/uv pip compile pyproject.toml --all-extras --universal --python-version 3.11 --constraint requirements.lock --generate-hashes --no-header --output-file requirements-image.lock
