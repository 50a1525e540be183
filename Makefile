# Everything that this project makes, with GNU make 3.81 or newer: `make help` shows the main targets, `make list` the rest.
#
# A notebook runs again when an input is newer than its stamp in build/stamps, or when an output is not as made. Committed
# files have the times of the checkout, so outputs are never compared with inputs: a fresh clone makes everything.

PAPER := 02_distillation 01_teacher 05_ledger 03_evaluation 04_appendix_tables # in an order in which no core waits
BEYOND := 08_proofs 09_methods 06_few_equations 07_limits 10_robots 11_agents 12_drone
NOTEBOOKS := $(sort $(PAPER) $(BEYOND))
USE_RUNS := 03_evaluation 04_appendix_tables 05_ledger
SUMMARIES := data/results/SimpleGoal-v0.csv data/results/MountainCarContinuous-v0.csv

# NOTEBOOK:FILE of every artefact in notebooks/captions.toml. The name "beyond/x" stands for files in figures/beyond.
ARTEFACTS := $(shell awk -F '[][."]+' ' \
  /^\[/ { n = split($$4, name, "/"); folder = $$2 ":figures/" (n > 1 ? name[1] "/" : ""); tables = $$3 == "tables" } \
  /^caption/ { file = folder (tables ? "tables/" : "") name[n] "."; \
    print file (tables ? "tex" : "pdf"), file (tables ? "csv" : "png") }' notebooks/captions.toml)
executed = figures/$(if $(filter $(1),$(BEYOND)),beyond/)executed
outputs = $(call executed,$(1))/$(1).ipynb $(patsubst $(1):%,%,$(filter $(1):%,$(ARTEFACTS))) \
  $(if $(filter 03_evaluation,$(1)),$(SUMMARIES))
inputs = notebooks/$(1).ipynb notebooks/captions.toml notebooks/headings.toml environment.lock vsp data/paper data/teachers \
  $(if $(filter $(1),$(BEYOND)),vsp_beyond studies data/beyond) \
  $(if $(filter 05_ledger,$(1)),$(wildcard data/results/*_*.csv) data/results/verdicts.csv) \
  $(if $(filter 02_% 04_% 06_%,$(1)),data/results/simpler.csv)

# What a user may set is read from the environment ("$$OUT"), and MAKEOVERRIDES is empty, so that nothing expands it.
OUT ?= .
# How many processes and notebooks at a time; with DASK, a scheduler's address, its workers make the runs.
JOBS := $(or $(value JOBS),$(shell getconf _NPROCESSORS_ONLN || echo 1))
$(if $(strip $(value OUT)),,$(error OUT is empty, expected a folder, as in OUT=scratch))
override OUT := $(if $(filter /% .%,$(firstword $(value OUT))),,./)$(value OUT)
$(foreach v,JOBS DASK PYTHON QUICK FORCE AGENT AGENTS FILES,$(eval override $(v) := $$(value $(v))))
STAMPS := $(OUT)/build/stamps
export OUT JOBS DASK PYTHON QUICK FORCE STAMPS AGENT AGENTS FILES
MAKEOVERRIDES :=
PY := .venv/bin/python

# The same bytes everywhere: no dates, no order by hash, one thread, nobody's settings; kernels: vsp/run/kernels.py.
export SOURCE_DATE_EPOCH := 1763337600
export PYTHONHASHSEED := 0
export PYTHONUTF8 := 1
$(foreach v,OMP_NUM OPENBLAS_NUM MKL_NUM VECLIB_MAXIMUM NUMEXPR_NUM,$(eval export $(v)_THREADS := 1))
export JUPYTER_PREFER_ENV_PATH := 1
export SDL_VIDEODRIVER := dummy
export MPLCONFIGDIR := $(CURDIR)/.venv/matplotlib
unexport MPLBACKEND MATPLOTLIBRC JUPYTER_PATH PIP_USER PIP_TARGET PIP_PREFIX
unexport PYTHONDONTWRITEBYTECODE PYTHONPATH PYTHONHOME PYTHONSTARTUP

# The parts of environment.lock that a target needs are in the name of its environment: venv-train adds `train`.
ENVIRONMENTS := venv venv-train venv-train-mujoco venv-mujoco venv-test-train venv-test-train-dask venv-site venv-train-site-test
.PHONY: help list quick paper-figures beyond-figures all lab runs study hidden hub-teacher agents drone proofs theorem course article site test \
  test-js test-long test-tries lint test-site manifest lock clean bench stale beyond short-teachers beyond-long faults teachers begin \
  $(ENVIRONMENTS) $(NOTEBOOKS) $(foreach n,$(NOTEBOOKS),$(call outputs,$(n)))

# $(call once,NAME,INPUTS,OUTPUTS,COMMAND): COMMAND, unless its stamp, of the time at which it began, has this QUICK and the
# checksums of OUTPUTS, and no file of INPUTS is newer. What was edited since, and git does not hold, stays without FORCE=1.
once = stamp="$$STAMPS/$(1)"; now() { echo "quick=$$QUICK"; (cd "$$OUT" && cksum $(3) 2>&1 < /dev/null); }; found="$$(now)"; \
  test "$$found" = "$$(cat "$$stamp" 2> /dev/null)" \
  && test -z "$$(find $(2) -type f ! -path '*__pycache__*' -newer "$$stamp" 2>&1 | head -n 1)" || { \
  for f in $$(test ! -f "$$stamp" || echo "$$found" | grep -vxFf "$$stamp" | sed -n 's/^[0-9]* [0-9]* //p'); do \
    { grep -q " $$f$$" "$$stamp" && ! (cd "$$OUT" && git diff --quiet HEAD -- "$$f" && git ls-files --error-unmatch "$$f"); } \
      > /dev/null 2>&1 || continue; test "$$FORCE" && rm "$$OUT/$$f" && continue; \
    echo "error: $$OUT/$$f was edited or damaged since make made it: keep a copy; FORCE=1 makes it anew" >&2; exit 1; done; \
  : > "$$stamp.new" && $(4) && now > "$$stamp.made" && touch -r "$$stamp.new" "$$stamp.made" && mv "$$stamp.made" "$$stamp"; }

targets = awk -F ':.*\#\#$(1) ' '/^\#\# /{title = "\n" substr($$0, 4) "\n"} \
  /^[a-z-]+:.*\#\#$(1) /{printf "%s  %-15s %s\n", title, $$1, $$2; title = ""}' Makefile

help:
	@echo 'make TARGET [OUT=folder] [FORCE=1] [JOBS=processes] [DASK=tcp://scheduler:8786] [PYTHON=/path/to/python3.11]'
	@echo 'Times are for 2 cores. The first target also sets up .venv (1 to 3 minutes, and 0.2 GB of downloads).'
	@$(call targets,)

## Start here
quick: ## all steps of the paper with few runs, figures watermarked, into build/quick/: 1 to 2 minutes
	@OUT="$$OUT/build/quick" QUICK=1 $(MAKE) --no-print-directory paper-figures

paper-figures: ## every figure and table of the paper, at the paper's scale (notebooks 01 to 05): 1 to 4 minutes
lab: venv ## opens JupyterLab on the notebooks
	@env -u MAKELEVEL JUPYTER_CONFIG_PATH="$(CURDIR)/.jupyter" $(PY) -m jupyterlab notebooks/01_teacher.ipynb

## Reproduce
beyond-figures: ## what goes beyond the paper, our own method (notebooks 06 onward): 1 to 5 minutes
all: ## both: 2 to 8 minutes
paper-figures: GOALS = runs $(PAPER)
beyond-figures: GOALS = $(BEYOND)
all: GOALS = runs $(BEYOND) $(PAPER)
paper-figures beyond-figures all: begin venv
	@: > "$$STAMPS/made"
	@$(MAKE) --no-print-directory -j "$$JOBS" $(GOALS)
	@if [ -s "$$STAMPS/made" ]; then printf 'made %s: see %s/figures\n' "$$(xargs < "$$STAMPS/made")" "$$OUT"; \
	$(PY) vsp/run/kernels.py; else printf 'everything is up to date: see %s/figures\n' "$$OUT"; fi

runs: begin venv ## the 85 + 40 distillations and their evaluation, into data/runs/: 1 to 2 minutes, resumable
	@$(call once,runs,vsp data/teachers environment.lock,$$(cat build/stamps/runs-made),\
	  $(PY) -m vsp.paper.make_runs --out="$$OUT" --jobs="$${DASK:-$$JOBS}" $${QUICK:+--quick} && \
	  (cd "$$OUT" && mkdir -p data/runs && find data/runs -name '*.run' > build/stamps/runs-made))

study: begin venv ##- simpler policies, and how often verdicts are wrong, into data/results/: 10 to 30 minutes, resumable
	$(PY) -m studies.make_study --out="$$OUT" --jobs="$${DASK:-$$JOBS}"
	test -z "$$AGENT" || $(PY) -m studies.make_study --agent="$$AGENT" --out="$$OUT" --jobs="$${DASK:-$$JOBS}"
hidden: begin venv ##- search for the settings that the paper does not print, into data/results/hidden_*.csv: 4 HOURS on two cores, resumable
	$(PY) -m studies.make_study --hidden --out="$$OUT" --jobs="$${DASK:-$$JOBS}"
hub-teacher: begin venv ##- the paper's MountainCar part with the teacher in AGENT=file.zip, into build/hub/: 1 to 2 minutes
	$(PY) -m studies.make_study --agent="$${AGENT:?expected AGENT=file.zip}" --out="$$OUT/build/hub" --jobs="$${DASK:-$$JOBS}"
agents: begin venv ##- reads, plays and distils the zips in AGENTS=folder, into data/beyond/: 10 minutes an agent or little more, resumable
	$(PY) -m studies.zoo "$${AGENTS:?expected AGENTS=folder}" --out="$$OUT" --jobs="$$JOBS"
drone: begin venv ##- flies our drone's network and maps of it, or the network that flew with AGENT=actor.h, into data/beyond/: 10 to 30 minutes, resumable
	$(PY) -m studies.drone --agent="$$AGENT" --out="$$OUT" --jobs="$$JOBS"
stale: venv ##- lists committed results of ours made with other settings, teachers or versions than today's
	@$(PY) -m studies.comparison.stale
proofs: begin venv ##- proofs for ten policies: certificates into data/beyond/proofs/, and tables: 10 to 30 minutes, resumable
	$(PY) -m studies.make_proofs --out="$$OUT" --jobs="$${DASK:-$$JOBS}"
theorem: begin venv ##- lets Coq prove that three cells reach SimpleGoal's goal from every start outside the pit, in build/theorem/: 1 minute
	@$(PY) -m vsp_beyond.proofs.theorem "$$OUT/build/theorem"

## Study
course: begin venv ## three lessons: hand-out, solutions, slides, the lecturer's guide, into build/course/: 10 to 20 s
	@$(PY) -m vsp_course.build --out="$$OUT"
article: begin venv ## the article of ten minutes: docs/article.html, one file that opens from disk: under 1 minute
	@$(PY) docs/article/build.py "$$OUT"

# Pages are laid out as the repository is, so that links work on both. The old site stays until the new one is whole.
site test-site: export SITE := $(OUT)/build/site
site: begin venv-site ## the companion as pages for a browser, into build/site/: 1 to 3 minutes
	@$(PY) -m vsp_course.build --pages --out="$$OUT"
	@rm -rf "$$SITE-work"; source="$$SITE-work/source"; mkdir -p "$$source/notebooks/course" "$$source/data"; \
	cp docs/*.md docs/*.svg README.md CITATION.cff "$$source"; cp -R figures "$$source"; \
	cp figures/executed/*.ipynb figures/beyond/executed/*.ipynb "$$source/notebooks"; \
	rm -r "$$source/figures/executed" "$$source/figures/beyond/executed"; \
	cp data/README.md "$$source/data"; \
	cp "$$OUT"/build/course/pages/*.ipynb "$$source/notebooks/course"
	@$(PY) -m sphinx -q -W -c docs -d "$$SITE-work/doctrees" "$$SITE-work/source" "$$SITE-work/pages"
	@cp -R "$$OUT/build/course/pages/course" "$$SITE-work/pages"; rm -rf "$$SITE"; mv "$$SITE-work/pages" "$$SITE"; \
	rm -r "$$SITE-work"; printf 'made: run %s -m http.server -d %s and open http://localhost:8000\n' "$(PY)" "$$SITE"

## Develop
PYTEST = tmp=$$(mktemp -d) && trap 'rm -rf "$$tmp"' EXIT && TMPDIR="$$tmp" MPLBACKEND=Agg $(PY) -m pytest -q -rs

test: venv-test-train-dask ## runs the tests: 2 to 6 minutes; FILES=tests/test_geometry.py: one module, in seconds
	@$(PYTEST) $${FILES:--n logical --maxprocesses 4 --dist worksteal --durations=10 tests}

test-long: venv-test-train-dask ## runs tests of whole commands, kills and a cluster: 2 to 8 minutes
	@$(PYTEST) -n 2 --dist worksteal tests/long
test-tries: venv-test-train-dask ##- runs what the notebooks suggest to try, and other parameters, at full size: 2 to 10 minutes
	@VSP_FULL=1 $(PYTEST) tests/long/test_tries.py tests/long/test_edits.py

test-js: ##- tests the scripts of explorer, article and site without a browser, which needs Node.js 20.19: 3 s
	@command -v node > /dev/null || { echo 'error: no node found: install Node.js 20.19 or newer' >&2; exit 1; }
	@node --no-warnings --test tests/js/modules.test.mjs

lint: venv-test-train ## runs ruff and mypy, as .pre-commit-config.yaml does before a commit; `ruff format` repairs the layout
	@$(PY) -m ruff check && $(PY) -m ruff format --check && $(PY) -m mypy

test-site: site venv-train-site-test ##- tests site and JupyterLab in a browser, which needs Chromium: 7 to 15 minutes
	@$(PYTEST) -n 2 --dist loadfile -k 'not smoothly and not meanwhile' tests/site
	@$(PYTEST) -k 'smoothly or meanwhile' tests/site # alone, because they measure times

manifest: venv ##- accepts the files of data/ as they are, after you changed one on purpose: at once
	@$(PY) -m vsp.run.manifest

clean: ## removes build/ (but build/course, where somebody may have written) and data/runs/: at once
	@test ! -d "$$OUT/build" || find "$$OUT/build" -mindepth 1 -maxdepth 1 ! -name course -exec rm -rf {} +
	@rm -rf "$$OUT/data/runs"
	@for d in figures data; do test ! -d "$$OUT/$$d" || find "$$OUT/$$d" -type f -name '.?*-????????.*' -delete; done

lock: venv ##- resolves environment.lock again, keeping versions that fit (UPGRADE=1: the newest): 20 s
	@.ci/lock $(if $(UPGRADE),--upgrade)

list: ## shows rarely used targets, also those that take hours, and every artefact with its notebook
	@$(call targets,-)
	@printf '\n%s\n' 'One artefact, or the notebook that makes it (with the runs in place: under 2 minutes)'
	@$(foreach n,$(NOTEBOOKS),printf '  %s\n' $(n); printf '    %s\n' $(call outputs,$(n));)

## Takes hours
# What did not hold (pytest's status 1) is recorded too; tables go to data/results/ when all is measured.
MEASURE = $(PYTEST) $(1) --record "$$OUT/build/measured"; status=$$?; test $$status -le 1 && \
  $(PY) tests/measured.py "$$OUT/build/measured" "$$OUT/data/results" && exit $$status

bench: venv-test-train-dask ##- measures speed and scale, into data/results/: an HOUR or more, on an idle machine
	@$(call MEASURE,tests/bench)
faults: venv-test-train-dask ##- runs the fault-injection tests, into data/results/: 3 HOURS or more
	@$(call MEASURE,tests/faults)
beyond: begin venv-train ##- compares our own method with others, into data/beyond/: 6 to 7 HOURS for all rows; resumable
	$(PY) -m studies.make_rows --out="$$OUT" --jobs="$${DASK:-$$JOBS}"
beyond-long: begin venv-train-mujoco ##- the same for LunarLander and two robots: 27 HOURS or more for all rows; resumable
	$(PY) -m studies.make_rows --long --out="$$OUT" --jobs="$${DASK:-$$JOBS}"
short-teachers: venv-train ##- trains the teachers that `make study` compares: 1 to 2 HOURS; resumes from $VSP_CACHE
	$(PY) -m studies.make_teachers --short --cache="$${VSP_CACHE:-$$HOME/.cache/vsp}" --out="$$OUT/data/teachers"
teachers: venv-train-mujoco ##- trains the TD3 teachers from scratch: 9 to 11 HOURS; resumes from $VSP_CACHE (~/.cache/vsp)
	$(PY) -m studies.make_teachers --cache="$${VSP_CACHE:-$$HOME/.cache/vsp}" --out="$$OUT/data/teachers"

$(ENVIRONMENTS):
	@sh environment.sh $(sort draw $(if $(DASK),dask) $(filter-out venv,$(subst -, ,$@)))

begin:
	@case $$JOBS in ''|0*|*[!0-9]*) printf 'error: JOBS is %s, expected a number from 1 on\n' "$$JOBS" >&2; exit 1;; esac
	@mkdir -p "$$STAMPS" && test -w "$$STAMPS" || { \
	  printf 'error: %s cannot be written: make it writable, or name another: `make OUT=folder`\n' "$$OUT" >&2; exit 1; }

$(USE_RUNS): runs
$(NOTEBOOKS): begin venv
	@$(call once,$@,$(call inputs,$@) $(if $(filter $@,$(USE_RUNS)),"$$STAMPS/runs"),$(call outputs,$@),\
	  $(PY) -m vsp.run.run_notebook notebooks/$@.ipynb --out="$$OUT" --executed=$(call executed,$@) \
	  $${QUICK:+--quick} --expect $(call outputs,$@) && echo $@ >> "$$STAMPS/made")
$(foreach n,$(NOTEBOOKS),$(eval $(call outputs,$(n)): $(n) ;))
