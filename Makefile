# Two commands matter: `make demo` and `make test`. Both set the project up on a bare machine first.
PYTHON ?= python3
SERVE ?= 1
VENV := .venv
BIN := $(VENV)/bin

.PHONY: demo test test-all test-fast warm runtime setup system-runtime system-tests lint types web-types unit lock catalogues test-windows wheelhouse portable release

runtime: $(VENV)/.runtime

setup: $(VENV)/.development

# By uv, which takes half of pip's time; by pip where uv finds no way, as behind an index that only pip is told of.
INSTALL = install() { $(BIN)/python -m uv pip install --quiet --python $(BIN)/python "$$@" || $(BIN)/python -m pip install --quiet "$$@"; }; install

$(VENV)/.runtime: pyproject.toml requirements-runtime.lock requirements-uv.lock
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' \
	  || { echo "scancell needs Python 3.11 or newer; $(PYTHON) is older. Try: make PYTHON=python3.12 $(MAKECMDGOALS)"; exit 2; }
	@test -x $(BIN)/python || $(PYTHON) -m venv $(VENV) \
	  || { echo "python3 -m venv failed; on Debian: apt-get install python3-venv"; exit 2; }
	-$(BIN)/python -m pip install --quiet --require-hashes --requirement requirements-uv.lock
	$(INSTALL) --require-hashes --requirement requirements-runtime.lock
	$(INSTALL) --no-deps --no-build-isolation --editable .
	@touch $@

$(VENV)/.development: $(VENV)/.runtime requirements.lock
	$(INSTALL) --require-hashes --requirement requirements.lock
	@touch $@

system-runtime system-tests:
	@sh .ci/system-packages $(@:system-%=%)

demo:
	@sh .ci/system-packages venv
	@$(MAKE) --no-print-directory --jobs 2 system-runtime runtime
	$(BIN)/scancell demo $(if $(filter 0,$(SERVE)),--no-serve,)

warm: runtime
	$(BIN)/scancell warm

test: BRIEF = --brief
test test-all:
	@sh .ci/system-packages venv
	@$(MAKE) --no-print-directory --jobs 2 system-tests setup
	$(MAKE) --jobs 2 --output-sync=target warm types lint web-types  # two at a time: the kernels are compiled meanwhile
	$(MAKE) unit BRIEF=$(BRIEF)

lint: setup
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

types: setup
	$(BIN)/pyright

web-types: setup
	$(BIN)/python tests/web/check_types.py

# A test that fails beside others is run once more, alone: what passes then depends on time, and is told as that.
unit: setup
	@$(BIN)/python -m pytest $(BRIEF) -n 4 --dist worksteal --durations=25; code=$$?; \
	if [ $$code -ne 1 ]; then exit $$code; fi; \
	echo "The tests above failed beside others. Each is run once more, alone; one that passes now depends on time: mend it."; \
	$(BIN)/python -m pytest --last-failed --last-failed-no-failures none

test-fast: setup
	@$(BIN)/python -m pytest -n 2 --dist worksteal -p tests.fast -r fE tests/core tests/server

catalogues: setup
	$(BIN)/python -m tests.catalogues

# The wheel, the server, its page and the portable zip on a Windows Python: WINDOWS_PYTHON is a folder whose program
# `python` runs one. No part of `make test`.
test-windows: setup
	WINDOWS_PYTHON="$(WINDOWS_PYTHON)" $(BIN)/python -m pytest tests/windows/on_windows*.py $(WINDOWS_TESTS)

# One thing in five files, without names of hosts: what is developed with; what the demo runs; what the image has, and what builds its wheel; the installer.
COMPILE = $(BIN)/python -m uv pip compile --universal --python-version 3.11 --generate-hashes --no-header --no-annotate --quiet
# All wheels for a machine without a network: PLATFORM is windows, linux, linux-arm or macos-arm.
PLATFORM ?= windows
PYTHON_VERSION ?= 3.12
OUT ?= dist
wheelhouse: setup
	$(BIN)/python .ci/wheelhouse.py $(PLATFORM) $(OUT)/wheelhouse-$(PLATFORM)-$(PYTHON_VERSION) --python $(PYTHON_VERSION)

# A folder in a zip that runs on Windows without an installation: PYTHON_ZIP is the embeddable Python of python.org.
portable: setup
	$(BIN)/python .ci/portable.py "$(PYTHON_ZIP)" $(OUT) $(if $(KERNELS),--kernels "$(KERNELS)") $(if $(WINDOWS_PYTHON),--windows-python "$(WINDOWS_PYTHON)/python") $(if $(RUNTIME),--runtime "$(RUNTIME)")

release: setup
	$(BIN)/python .ci/release.py $(OUT) $(if $(PYTHON_ZIP),--python-zip "$(PYTHON_ZIP)") $(if $(KERNELS),--kernels "$(KERNELS)") $(if $(WINDOWS_PYTHON),--windows-python "$(WINDOWS_PYTHON)/python") $(if $(RUNTIME),--runtime "$(RUNTIME)") $(if $(SIGNING_KEY),--signing-key "$(SIGNING_KEY)") $(if $(IMAGE_TOOL),--image-tool $(IMAGE_TOOL))

lock: runtime
	$(COMPILE) pyproject.toml --all-extras --group dev --group build --group installer --output-file requirements.lock
	$(COMPILE) pyproject.toml --group build --constraint requirements.lock --output-file requirements-runtime.lock
	$(COMPILE) pyproject.toml --all-extras --constraint requirements.lock --output-file requirements-image.lock
	$(COMPILE) --group build --constraint requirements.lock --output-file requirements-build.lock
	$(COMPILE) --group installer --constraint requirements.lock --output-file requirements-uv.lock
