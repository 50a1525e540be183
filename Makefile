# Everything that this project makes, with GNU make 3.81 or newer. `make help` lists the targets.
#
# What is up to date is decided by content, never by file times (a fresh clone has no order in them): build/state holds,
# for every notebook, the checksums of all that it read and made. An altered, deleted or never made file is made again.

# What each notebook makes: figures/ (PDF and PNG; of animations GIF, and PNG in its stead), figures/tables/ (TEX and
# CSV) and data/results/.
FIGURES_01_teacher := environments teacher_policies teacher_returns
FIGURES_02_distillation := voronoi_example one_linear_map distillation_history partition_growth distilled_error failure
FIGURES_03_evaluation := simplegoal_returns simplegoal_policies mountaincar_returns mountaincar_policies run_means
RESULTS_03_evaluation := SimpleGoal-v0.csv MountainCarContinuous-v0.csv
TABLES_04_appendix_tables := tdavq_comparison hyperparameters simplegoal_linear_policies mountaincar_linear_policies \
  simplegoal_spread mountaincar_spread text_numbers
FIGURES_05_ledger := ledger whisker_bounds what_cells_buy readings_study teacher_study
TABLES_05_ledger := ledger left_out audit what_cells_buy readings_study teacher_study
FIGURES_06_few_equations := $(addprefix beyond_,read explained map likeness)
TABLES_06_few_equations := $(addprefix beyond_,leaders faithful)
FIGURES_07_limits := limit_cells limit_dead_point limit_fit_times limit_robots limit_strides
ANIMATIONS_07_limits := gait_halfcheetah
TABLES_07_limits := $(addprefix limit_,references sizes starts losses robots gait fewest)
FIGURES_08_proofs := proofs_basins proofs_mountaincar proofs_pendulum
TABLES_08_proofs := $(addprefix proofs_,simplegoal dead_points pendulum teacher)
FIGURES_09_methods := beyond_rivals beyond_ablation lookup_times
TABLES_09_methods := $(addprefix beyond_,equal headline tail apart sizes teachers budgets rules simplegoal mountaincar \
  pendulum lunarlander ablation pendulum_policy)
# In an order in which no core waits; which of them read data/runs, and which committed results.
PAPER := 02_distillation 01_teacher 05_ledger 03_evaluation 04_appendix_tables
OURS := 08_proofs 09_methods 06_few_equations 07_limits
NOTEBOOKS := $(sort $(PAPER) $(OURS))
NEED_RUNS := 03_evaluation 04_appendix_tables 05_ledger
SMALL := SimpleGoal-v0 MountainCarContinuous-v0 Pendulum-v1
ROWS := $(foreach n,$(SMALL),beyond_$(n))
READS_OURS := $(foreach n,$(ROWS) optimum \
  $(foreach t,$(SMALL),$(foreach table,tuned apart faithful demanded same,$(table)_$(t))) \
  $(foreach table,beyond tuned faithful same,$(table)_LunarLanderContinuous-v3),data/results/$(n).csv) \
  data/results/faithful_SimpleGoal-v0.policy
READS_06_few_equations := $(READS_OURS)
READS_07_limits := $(foreach n,$(ROWS) $(addprefix limit_,$(SMALL) LunarLanderContinuous-v3) \
  starts_MountainCarContinuous-v0 optimum fits $(addsuffix _SimpleGoal-v0,tuned apart faithful demanded) \
  $(foreach r,BipedalWalker-v3 HalfCheetah-v5,robots_$(r) gait_$(r) fewest_$(r)),data/results/$(n).csv) \
  data/results/faithful_Pendulum-v1.policy data/results/robots_HalfCheetah-v5.policy
READS_08_proofs := $(foreach n,paper tuned,data/proofs/simplegoal_$(n).json) data/proofs/mountaincar_limit.json \
  data/proofs/pendulum_faithful.json data/results/faithful_MountainCarContinuous-v0.policy \
  $(foreach n,proofs proofs_grid proofs_teacher,data/results/$(n).csv)
READS_09_methods := $(READS_OURS) $(foreach n,lookup $(foreach t,$(SMALL),teachers_$(t)) \
  $(foreach table,beyond tuned faithful,$(table)_seconds $(table)_seconds_long),data/results/$(n).csv) \
  data/results/beyond_LunarLanderContinuous-v3.policy
READS_05_ledger := $(addprefix data/results/,readings.csv teachers.csv simpler.csv)

# What a user may set. Recipes read it from the environment, as "$$OUT", so that no character in it means anything to
# make or to the shell. MAKEOVERRIDES is empty, for a make inside a recipe would expand what it holds.
OUT ?= .
# How many processes and notebooks at a time; with DASK, a scheduler's address, its workers make the runs.
JOBS := $(or $(value JOBS),$(shell getconf _NPROCESSORS_ONLN || echo 1))
ifeq ($(strip $(value OUT)),)
$(error OUT is empty, expected a folder, as in OUT=scratch)
endif
override OUT := $(if $(filter /% .%,$(firstword $(value OUT))),,./)$(value OUT)
$(foreach v,JOBS DASK PYTHON QUICK,$(eval override $(v) := $$(value $(v))))
STATE := $(OUT)/build/state
export OUT JOBS DASK PYTHON QUICK STATE
MAKEOVERRIDES :=

PY := .venv/bin/python
INPUTS := $(sort $(shell find vsp vsp_beyond studies -name '*.py') $(wildcard data/paper/* data/teachers/*.* data/teachers/short/*)) \
  environment.lock
outputs = figures/executed/$(1).ipynb $(foreach f,$(FIGURES_$(1)),figures/$(f).pdf figures/$(f).png) \
  $(foreach a,$(ANIMATIONS_$(1)),figures/$(a).gif figures/$(a).png) \
  $(foreach t,$(TABLES_$(1)),figures/tables/$(t).tex figures/tables/$(t).csv) \
  $(addprefix data/results/,$(RESULTS_$(1)))

# The same bytes everywhere: no dates in files, no order by hash, one thread per process, nobody's personal settings.
export SOURCE_DATE_EPOCH := 1763337600
export PYTHONHASHSEED := 0
export PYTHONUTF8 := 1
export OMP_NUM_THREADS := 1
export OPENBLAS_NUM_THREADS := 1
export MKL_NUM_THREADS := 1
export VECLIB_MAXIMUM_THREADS := 1
export NUMEXPR_NUM_THREADS := 1
export JUPYTER_PREFER_ENV_PATH := 1
export SDL_VIDEODRIVER := dummy
export MPLCONFIGDIR := $(CURDIR)/.venv/matplotlib
unexport MPLBACKEND MATPLOTLIBRC JUPYTER_PATH PIP_USER PIP_TARGET PIP_PREFIX
unexport PYTHONDONTWRITEBYTECODE PYTHONPATH PYTHONHOME PYTHONSTARTUP

# The parts of environment.lock that a target needs are in the name of its environment: venv-train adds `train`.
ENVIRONMENTS := venv venv-train venv-train-mujoco venv-mujoco venv-test venv-test-train-dask venv-site venv-site-test
.PHONY: help quick paper-figures all lab runs study lookup proofs proofs-teacher course site test test-long lint \
  test-site manifest lock clean bench beyond short-teachers beyond-long faults teachers begin $(ENVIRONMENTS) $(NOTEBOOKS)

help:
	@echo 'make TARGET [OUT=folder] [JOBS=processes] [DASK=tcp://scheduler:8786] [PYTHON=/path/to/python3.11]'
	@echo 'Times are for 2 cores; the first target also sets up .venv (a minute, and 0.2 GB of downloads).'
	@awk -F ':.*## ' '/^## /{print "\n" substr($$0, 4)} /^[a-z-]+:.*## /{printf "  %-14s %s\n", $$1, $$2}' Makefile
	@printf '\nor one artefact (under a minute each, once the runs are there), or the notebook that makes it:\n\n'
	@$(foreach n,$(NOTEBOOKS),echo '  $(n)'; \
	  $(foreach f,$(FIGURES_$(n)),echo '    figures/$(f).pdf .png';) \
	  $(foreach a,$(ANIMATIONS_$(n)),echo '    figures/$(a).gif .png';) \
	  $(foreach t,$(TABLES_$(n)),echo '    figures/tables/$(t).tex .csv';) \
	  $(foreach r,$(RESULTS_$(n)),echo '    data/results/$(r)';)) true

## Start here
quick: ## all steps of the paper with few runs, figures watermarked, into build/quick/: about a minute
	@OUT="$$OUT/build/quick" QUICK=1 $(MAKE) --no-print-directory paper-figures

paper-figures: begin ## every figure and table of the paper, at the paper's scale: 1.5 minutes
lab: venv ## opens JupyterLab on the notebooks
	@$(PY) -m vsp.run.lab

## Reproduce
all: begin venv ## paper-figures and notebooks 06 to 09, our own method: about 4 minutes
paper-figures all:
	@: > "$$STATE/made"
	@$(MAKE) --no-print-directory -j "$$JOBS" runs $(if $(filter all,$@),$(OURS)) $(PAPER)
	@if [ -s "$$STATE/made" ]; then printf 'made %s: see %s/figures\n' "$$(xargs < "$$STATE/made")" "$$OUT"; \
	  $(PY) -m studies.comparison.stale > "$$STATE/stale" || exit 1; \
	else printf 'everything is up to date: see %s/figures\n' "$$OUT"; fi; test ! -s "$$STATE/stale" || cat "$$STATE/stale"

runs: begin venv ## the 85 + 40 distillations and their evaluation, into data/runs/: under a minute, resumable
	@mkdir -p "$$OUT/data/runs"; inputs=$$(cksum $(INPUTS)) || exit 1; \
	state() { echo "$$inputs quick=$$QUICK"; \
	  (cd "$$OUT/data/runs" && find . -type f | LC_ALL=C sort | xargs cksum 2>/dev/null); }; \
	if ! state | cmp -s - "$$STATE/runs"; then \
	  $(PY) -m vsp.paper.make_runs --out="$$OUT" --jobs="$${DASK:-$$JOBS}" $${QUICK:+--quick} && state > "$$STATE/runs"; fi

study: begin venv ## studies of the readings, the teachers and simpler policies, into data/results/: 15 minutes, resumable
	$(PY) -m vsp.paper.studies.make_studies --out="$$OUT" --jobs="$${DASK:-$$JOBS}"

lookup: begin venv ## times of look-ups, neighbour graphs and fits in many dimensions, into data/results/: 4 minutes
	$(PY) -m studies.benchmarks.lookup --out="$$OUT"
	$(PY) -m studies.benchmarks.fits --out="$$OUT"

proofs: begin venv ## proofs for ten policies: certificates into data/proofs/, and tables: 10 minutes, resumable
	$(PY) -m studies.make_proofs --out="$$OUT" --jobs="$${DASK:-$$JOBS}"

proofs-teacher: begin venv ## proofs for a network, for at most an HOUR, into data/results/
	$(PY) -m studies.make_proofs --teacher --out="$$OUT"

## Study
course: begin venv ## three lessons: hand-out for students, solutions, slides, the lecturer's guide, into build/course/: 3 s
	@$(PY) -m vsp_course.build --out="$$OUT"

# The pages are laid out as the repository is, so that a link of the README leads to the same thing on the site. The old
# site stays until the new one is whole.
site test-site: export SITE := $(OUT)/build/site
site: begin venv-site ## the companion as pages for a browser, into build/site/: about a minute
	@$(PY) -m vsp_course.pages --out="$$OUT"
	@rm -rf "$$SITE-work"; source="$$SITE-work/source"; \
	mkdir -p "$$source/notebooks/course" "$$source/data"; \
	cp docs/*.md README.md CITATION.cff "$$source"; \
	cp figures/executed/*.ipynb "$$source/notebooks"; \
	cp -R figures "$$source"; rm -r "$$source/figures/executed"; \
	cp data/README.md "$$source/data"; \
	cp "$$OUT"/build/course/pages/*.ipynb "$$source/notebooks/course"
	@$(PY) -m sphinx -q -W -c docs -d "$$SITE-work/doctrees" "$$SITE-work/source" "$$SITE-work/pages"
	@rm -rf "$$SITE"; mv "$$SITE-work/pages" "$$SITE"; rm -r "$$SITE-work"; \
	printf 'made: run %s -m http.server -d %s and open http://localhost:8000\n' "$(PY)" "$$SITE"

## Develop
test: venv-test-train-dask ## runs the tests, several at a time: about 3 minutes
	@MPLBACKEND=Agg $(PY) -m pytest -q -rs -n logical --maxprocesses 4 --dist worksteal tests

test-long: venv-test-train-dask ## runs tests of whole commands, kills and a cluster: about 2 minutes
	@MPLBACKEND=Agg $(PY) -m pytest -q -rs tests/long

lint: venv-test ## runs ruff and mypy, as .pre-commit-config.yaml does before a commit; `ruff format` repairs the layout
	@$(PY) -m ruff check && $(PY) -m ruff format --check && $(PY) -m mypy

test-site: site venv-site-test ## tests site and JupyterLab in a browser, which needs Chromium: about 7 minutes
	@MPLBACKEND=Agg $(PY) -m pytest -q -rs tests/site

manifest: venv ## updates the checksums of data/ after you changed a file on purpose: at once
	@$(PY) -m vsp.run.manifest

clean: ## removes build/ (but build/course, where somebody may have written) and data/runs/: at once
	@test ! -d "$$OUT/build" || find "$$OUT/build" -mindepth 1 -maxdepth 1 ! -name course -exec rm -rf {} +
	@rm -rf "$$OUT/data/runs"
	@for d in figures data; do test ! -d "$$OUT/$$d" || find "$$OUT/$$d" -type f -name '.?*-????????.*' -delete; done

lock: venv ## resolves environment.lock again, keeping versions that fit (UPGRADE=1: the newest): 20 s
	@.ci/lock $(if $(UPGRADE),--upgrade)

## Takes hours
# What did not hold (pytest's status 1) is recorded too; tables go to data/results/ when all is measured.
MEASURE = MPLBACKEND=Agg $(PY) -m pytest -q $(1) --record "$$OUT/build/measured"; status=$$?; test $$status -le 1
PUBLISH = $(PY) tests/measured.py "$$OUT/build/measured" "$$OUT/data/results" && exit $$status

bench: venv-test-train-dask ## measures speed and scale, into data/results/: an HOUR or more, on an idle machine
	@$(call MEASURE,tests/bench) && $(PUBLISH)

faults: venv-test-train-dask ## runs the fault-injection tests, into data/results/: 3 HOURS or more, resumable
	@$(call MEASURE,tests/faults) && $(PUBLISH)

beyond: begin venv-train ## compares our own method with others, into data/results/: 6 to 7 HOURS, resumable
	$(PY) -m studies.make_rows --out="$$OUT" --jobs="$${DASK:-$$JOBS}"

beyond-long: begin venv-train-mujoco ## the same for LunarLander and two robots, whose engines are slow: 27 HOURS or more, resumable
	$(PY) -m studies.make_rows --long --out="$$OUT" --jobs="$${DASK:-$$JOBS}"

short-teachers: venv-train ## trains the further teachers that `make study` compares: 1 to 2 HOURS; resumes from $VSP_CACHE
	$(PY) -m studies.make_teachers --short --cache="$${VSP_CACHE:-$$HOME/.cache/vsp}" --out="$$OUT/data/teachers"

teachers: venv-train-mujoco ## trains the TD3 teachers from scratch: 9 to 11 HOURS; resumes from $VSP_CACHE (~/.cache/vsp)
	$(PY) -m studies.make_teachers --cache="$${VSP_CACHE:-$$HOME/.cache/vsp}" --out="$$OUT/data/teachers"

# What others build on

$(ENVIRONMENTS):
	@sh environment.sh $(sort draw $(if $(DASK),dask) $(filter-out venv,$(subst -, ,$@)))

begin:
	@case $$JOBS in ''|0*|*[!0-9]*) printf 'error: JOBS is %s, expected a number from 1 on\n' "$$JOBS" >&2; exit 1;; esac
	@case $$DASK in ''|*://*) ;; *) \
	  printf 'error: DASK is %s, expected the address of a scheduler, as in tcp://host:8786\n' "$$DASK" >&2; exit 1;; esac
	@printf %s "$$OUT" | iconv -f UTF-8 -t UTF-8 > /dev/null 2>&1 || { echo 'error: OUT is not UTF-8' >&2; exit 1; }
	@mkdir -p "$$STATE" && test -w "$$STATE" || { \
	  printf 'error: %s cannot be written: make it writable, or name another: `make OUT=folder`\n' "$$OUT" >&2; exit 1; }

# $(1): a notebook. Its state is what it reads, as found before the run, and what it makes, as found after.
define notebook-rules
.PHONY: $(call outputs,$(1))
$(call outputs,$(1)): $(1) ;
$(1): begin venv $(if $(filter $(1),$(NEED_RUNS)),runs)
	@for file in $$(READS_$(1)); do test -f "$$$$file" || { echo "error: $$$$file is missing: \`git checkout $$$$file\` \
	brings it back; \`make study beyond beyond-long lookup\` makes all such files" >&2; exit 1; }; done; \
	inputs=$$$$(cksum $$(INPUTS) notebooks/$(1).ipynb notebooks/captions.toml notebooks/headings.toml $$(READS_$(1)) \
	  $(if $(filter $(1),$(NEED_RUNS)),"$$$$STATE/runs")) || exit 1; \
	state() { echo "$$$$inputs quick=$$$$QUICK"; (cd "$$$$OUT" && cksum $(call outputs,$(1)) 2>/dev/null); }; \
	if ! state | cmp -s - "$$$$STATE/$(1)"; then \
	  $$(PY) -m vsp.run.run_notebook notebooks/$(1).ipynb --out="$$$$OUT" $$$${QUICK:+-p quick true} \
	    --expect $(call outputs,$(1)) && state > "$$$$STATE/$(1)" && echo $(1) >> "$$$$STATE/made"; fi
endef
$(foreach n,$(NOTEBOOKS),$(eval $(call notebook-rules,$(n))))
