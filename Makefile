# Steadyhand: makes `.venv` from requirements.lock, then only forwards to the command.
# STUDY=path takes any study folder; ARGS="--jobs 2" hands options through.

.DEFAULT_GOAL := help
STUDY ?= studies/peephole
steadyhand := .venv/bin/steadyhand
python := .venv/bin/python

.PHONY: help report check replay simulate record marker explore power plan test compiled mutants test-browser test-pdf test-exports lint docs bench limits bench-live test-live soak lock clean

help: ## list the targets
	@awk -F ':.*## ' '/^[a-z-]+:.*## / {printf "  make %-12s %s\n", $$1, $$2}' $(MAKEFILE_LIST)

.venv/installed: requirements.lock pyproject.toml tools/make-venv tools/uv.lock
	@sh tools/make-venv

report: .venv/installed ## write the report of STUDY (default: the simulated study) into reports/
	@$(steadyhand) simulate --if-needed "$(STUDY)"
	@$(steadyhand) report "$(STUDY)" $(ARGS)

check: .venv/installed ## do the bundled studies' statistics still come out the same?
	@$(steadyhand) check studies/feng2016 studies/reach $(ARGS)

replay: STUDY = studies/reach
replay: .venv/installed ## variants of the estimators, ranked: ARGS="--set fusion.window=3,5,10"; STUDY=… for another study
	@$(steadyhand) replay "$(STUDY)" $(ARGS)

simulate: .venv/installed ## write the logs of a simulated STUDY anew
	@$(steadyhand) simulate "$(STUDY)" $(ARGS)

record: .venv/installed ## run STUDY live: ARGS="--demo" needs nothing but this computer
	@$(steadyhand) record "$(STUDY)" $(ARGS)

marker: .venv/installed ## a marker to print, for a webcam as tracker: ARGS="--id 8 --size-mm 80"
	@$(steadyhand) marker $(ARGS)

explore: STUDY = studies/peephole
explore: .venv/installed ## a better tracker or a better filter? a simulated STUDY under many trackers
	@$(steadyhand) explore "$(STUDY)" $(ARGS)

power: .venv/installed ## how many participants? ARGS="--effect 0.5"
	@$(steadyhand) power $(ARGS)

plan: .venv/installed ## counterbalanced orders: ARGS="kinect fusion --participants 12"
	@$(steadyhand) plan $(ARGS)

# Python's own bytecode is kept, whatever the shell says: some tests start processes, and each would translate all anew.
test compiled: export PYTHONDONTWRITEBYTECODE =
test: .venv/installed ## lint, then every test; ARGS=-mfast leaves out the slow ones
	@$(MAKE) --no-print-directory -j2 lint compiled
	@$(python) -m pytest -n auto --dist worksteal $(ARGS)

# Once, beside lint; else each of the tests' processes would compile for itself.
compiled: .venv/installed
	@$(python) -m tests.compiled

mutants: .venv/installed ## small faults put into accuracy, statistics and analysis: which does no test notice? (half an hour)
	@$(python) -m tests.mutants $(ARGS)

test-browser: .venv/installed ## the pages in Chromium at three widths, with axe-core (needs chromium; npm for axe-core); ARGS=reports or live: some of them
	@$(python) -m tests.browser $(ARGS)

test-pdf: .venv/installed ## the PDFs against PDF/UA-1 and PDF/A-2a by veraPDF (needs maven and a JDK)
	@$(python) -m tests.browser.pdf

test-exports: .venv/installed ## what export writes, by the validator of BIDS and by Rerun (250 MB, installed once)
	@sh tools/make-outside
	@$(python) -m pytest -q -rs tests/pipeline/commands/test_export_bids.py tests/pipeline/commands/test_export.py $(ARGS)

lint: .venv/installed ## ruff, mypy strict, import-linter
	@$(python) -m ruff check .
	@$(python) -m ruff format --check .
	@$(python) -m mypy
	@.venv/bin/lint-imports

docs: .venv/installed ## write docs/tables.md anew from the records in pipeline/tables
	@$(python) -m pipeline.tables.page

bench: .venv/installed ## how fast, as ratios in one run, beside other libraries
	@sh tools/make-peers
	@$(python) -m tests.benchmarks $(ARGS)

limits: .venv/installed ## how much a study may hold: seconds and memory of large studies (an hour); ARGS="trials": some of them
	@$(python) -m tests.benchmarks.limits $(ARGS)

bench-live: .venv/installed ## how soon a live study shows a reading, with 1 and 8 phones and under a flood (a quiet machine)
	@$(python) -m tests.benchmarks.live $(ARGS)

test-live: .venv/installed ## the same briefly; fails where a reading is lost or takes four times as long as it may
	@$(python) -m tests.benchmarks.live 14

soak: .venv/installed ## PHONES=8 for MINUTES=30: does memory stay flat, is a reading lost?
	@$(python) -m tests.benchmarks.live soak $(or $(MINUTES),30) $(or $(PHONES),8)

lock: .venv/installed ## bring requirements.lock up to date with pyproject.toml
	@sh tools/make-lock

clean: ## remove the environment, the caches and the written reports
	@rm -rf .venv .uv .steadyhand-cache .mypy_cache .ruff_cache .pytest_cache .hypothesis .import_linter_cache
	@find fusion_core pipeline tests -name __pycache__ -type d -prune -exec rm -rf {} +
	@find reports -mindepth 1 -maxdepth 1 ! -name README.md -exec rm -rf {} +
