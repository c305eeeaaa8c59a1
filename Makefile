# Two commands from a fresh clone, with only Python 3.11 or newer and make: `make run` and `make test`.
PYTHON ?= python3
BIN := .venv/bin

PAGE := workbench/view/page
VIEWER := $(PAGE)/build/viewer.js

.PHONY: install run walk test test-slow mutants lint docs clean

install: .venv/installed $(VIEWER)

.venv/installed: requirements.lock pyproject.toml
	$(PYTHON) -c "import sys; sys.exit(sys.version_info < (3, 11) and 'viewcell needs Python 3.11 or newer, found ' + sys.version.split()[0])"
	$(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --require-hashes -r requirements.lock
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation --editable .
	# Type checkers and editors do not run the finder of an editable install: they follow a path to `viewcell`.
	mkdir -p .venv/src && ln -sfn "$(CURDIR)" .venv/src/viewcell
	echo "$(CURDIR)/.venv/src" > "$$($(BIN)/python -c 'import site; print(site.getsitepackages()[0])')/viewcell_source.pth"
	touch $@

# The viewer's script, with three.js from npm; where that cannot be reached, all but `viewcell view` works.
$(VIEWER): .venv/installed $(wildcard $(PAGE)/*.mjs) $(PAGE)/package-lock.json
	-$(BIN)/python -m viewcell.workbench.view.build

run: install
	$(BIN)/viewcell make office --out out/office.scene --overwrite
	$(BIN)/viewcell bake out/office.scene --out out/office --overwrite
	$(BIN)/viewcell verify out/office
	# Where npm could not be reached there is no viewer; the report is.
	-$(BIN)/viewcell view out/office --out out/office.view --overwrite --no-open
	$(BIN)/viewcell report out/office
	@echo "open in a browser: $$(ls out/office.view/index.html 2>/dev/null || echo out/office/report/report.html)"

# An office of the size of Soda Hall, from the model to a walk that is checked (out/soda.tour), and to the papers' tables
# with all policies, a triangle as large as published (out/papers.tour).
walk: install
	$(BIN)/viewcell make office --like soda-hall --out out/soda.scene --overwrite
	$(BIN)/viewcell bake out/soda.scene --lods --out out/soda.bake --overwrite
	$(BIN)/viewcell pack out/soda.bake --flatten --out out/soda.walk --overwrite
	$(BIN)/viewcell walk out/soda.walk --check 20
	$(BIN)/viewcell walk out/soda.walk --policy all --polygon-bytes 158 --out out/papers.tour

# Stealing work leaves tests of a file in one process, so what they share is made once.
test: install
	$(BIN)/python -m pytest -n auto --dist worksteal

test-slow: install
	$(BIN)/python -m pytest -n auto --dist worksteal -m slow

# ONLY=TEXT tries the faults whose name or file holds the text.
mutants: install
	$(BIN)/python tests/mutants/run.py --only "$(ONLY)"

lint: install
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

# The site, with a link or anchor that leads nowhere as an error: out/docs/index.html.
docs: install
	$(BIN)/python -m sphinx -E -W --keep-going -q -b html docs out/docs

clean:
	rm -rf .venv out build dist *.egg-info
