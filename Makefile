# Everything that this project makes, with GNU make 3.81 or newer. `make help` lists the targets.
#
# What is up to date is decided by content, never by file times (a fresh clone has no order in them): build/state holds,
# for every notebook, the checksums of all that it read and made. An altered, deleted or never made file is made again.

# What each notebook makes: figures/ (PDF and PNG; of animations GIF, and PNG in its stead), figures/tables/ (TEX and
# CSV) and data/results/.
NOTEBOOKS := 01_teacher 02_distillation 03_evaluation 04_appendix_tables 05_ledger 06_beyond 07_trust
FIGURES_01_teacher := environments learning_curves teacher_policies teacher_returns
FIGURES_02_distillation := voronoi_example one_linear_map distillation_history partition_growth distilled_error failure
ANIMATIONS_02_distillation := growth_simplegoal growth_mountaincar
FIGURES_03_evaluation := simplegoal_returns simplegoal_policies mountaincar_returns mountaincar_policies run_means
RESULTS_03_evaluation := SimpleGoal-v0.csv MountainCarContinuous-v0.csv made_on.txt
TABLES_04_appendix_tables := tdavq_comparison hyperparameters simplegoal_linear_policies mountaincar_linear_policies \
  simplegoal_spread mountaincar_spread text_numbers
FIGURES_05_ledger := ledger whisker_bounds what_cells_buy readings_study teacher_study
TABLES_05_ledger := ledger left_out audit what_cells_buy readings_study teacher_study
FIGURES_06_beyond := beyond_partitions beyond_simplify beyond_simplegoal beyond_mountaincar beyond_pendulum \
  beyond_lunarlander beyond_ablation beyond_race beyond_explained lookup_times graph_times graph_shares
TABLES_06_beyond := beyond_headline beyond_ablation beyond_lunarlander \
  $(foreach t,simplegoal mountaincar pendulum,beyond_$(t) beyond_$(t)_policy beyond_$(t)_rules)
FIGURES_07_trust := kills trust_speed scale_time scale_dimensions scale_memory scale_workers cluster_cost
TABLES_07_trust := trust_faults trust_input trust_same trust_speed scale_exponents cluster_cost
# The notebooks that read data/runs, and what else they read: results of `make study`, `beyond`, `bench`, `torture`.
NEED_RUNS := 03_evaluation 04_appendix_tables 05_ledger
READS_05_ledger := data/results/readings.csv data/results/teachers.csv
READS_06_beyond := $(foreach n,beyond_SimpleGoal-v0 beyond_MountainCarContinuous-v0 beyond_Pendulum-v1 beyond_race \
  beyond_LunarLanderContinuous-v3 lookup,data/results/$(n).csv) data/results/beyond_LunarLanderContinuous-v3.policy
READS_07_trust := $(foreach n,trust kills scale,data/results/$(n).csv)

OUT ?= .
# How many processes and notebooks at a time; with DASK, a scheduler's address, its workers make the runs.
JOBS ?= $(shell getconf _NPROCESSORS_ONLN || echo 1)
QUICK ?=
DASK ?=
PYTHON ?=

ifneq ($(or $(JOBS),nothing),$(shell expr "$(JOBS)" : '\([1-9][0-9]*\)$$'))
$(error JOBS is $(JOBS), expected a number from 1 on)
endif
ifeq ($(strip $(OUT)),)
$(error OUT is empty, expected a folder, as in `make paper-figures OUT=scratch`)
endif

PY := .venv/bin/python
PIP := $(PY) -m pip --disable-pip-version-check
STATE = $(OUT)/build/state
INPUTS := $(sort $(wildcard vsp/*.py data/paper/* data/teachers/*.* data/teachers/short/*)) environment.lock
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
unexport MPLBACKEND MATPLOTLIBRC PYTHONPATH PYTHONHOME PYTHONSTARTUP JUPYTER_PATH PIP_USER PIP_TARGET PIP_PREFIX

.PHONY: help paper-figures quick runs study beyond beyond-long lookup teachers short-teachers manifest lab test bench torture clean course lock lock-site venv new-venv venv-site site test-site begin notebooks $(NOTEBOOKS)

help: ## this list
	@echo 'make TARGET [OUT=folder] [JOBS=processes] [DASK=tcp://scheduler:8786] [PYTHON=/path/to/python3.11]'
	@echo 'Times are for 2 cores; the first target also sets up .venv (about 2 minutes, and downloads).'
	@echo
	@sed -n 's/^\([a-z-]*\):[^#]*## \(.*\)/\1|\2/p' Makefile | awk -F'|' '{ printf "  %-14s %s\n", $$1, $$2 }'
	@echo
	@echo 'or the notebook that makes one artefact (under a minute each, once the runs are there):'
	@echo
	@$(foreach n,$(NOTEBOOKS),echo '  $(n)'; \
	  $(foreach f,$(FIGURES_$(n)),echo '    figures/$(f).pdf .png';) \
	  $(foreach a,$(ANIMATIONS_$(n)),echo '    figures/$(a).gif .png';) \
	  $(foreach t,$(TABLES_$(n)),echo '    figures/tables/$(t).tex .csv';) \
	  $(foreach r,$(RESULTS_$(n)),echo '    data/results/$(r)';)) true

paper-figures: begin ## every figure and table of the paper, at the paper's scale: about 3 minutes
	@$(MAKE) --no-print-directory -j $(JOBS) notebooks
	@if [ -s "$(STATE)/made" ]; then echo "made" $$(cat "$(STATE)/made")": see $(OUT)/figures"; \
	  $(PY) -m vsp.study --check > "$(STATE)/stale" || exit 1; \
	else echo "everything is up to date: see $(OUT)/figures"; fi; test ! -s "$(STATE)/stale" || cat "$(STATE)/stale"

begin:
	@mkdir -p "$(STATE)" && : > "$(STATE)/made" || { \
	  echo 'error: $(OUT) cannot be written: make it writable, or name another folder: `make OUT=folder`' >&2; exit 1; }

# The longest first, so that no core waits at the end.
notebooks: runs 06_beyond $(NOTEBOOKS)

quick: ## the same path with tiny runs, figures watermarked, into build/quick/: about a minute
	@$(MAKE) --no-print-directory paper-figures QUICK=1 OUT="$(OUT)/build/quick"

runs: venv ## the 85 + 40 distillations and their evaluation, into data/runs/: about 45 s, resumable
	@mkdir -p "$(STATE)" "$(OUT)/data/runs"; inputs=$$(cksum $(INPUTS)) || exit 1; \
	state() { echo "$$inputs quick=$(QUICK)"; \
	  (cd "$(OUT)/data/runs" && find . -type f | LC_ALL=C sort | xargs cksum 2>/dev/null); }; \
	if ! state | cmp -s - "$(STATE)/runs"; then \
	  $(PY) -m vsp.experiments --out "$(OUT)" --jobs $(or $(DASK),$(JOBS)) $(if $(QUICK),--quick) && state > "$(STATE)/runs"; fi

study: venv ## the studies of the readings and of the teachers, into data/results/: about 15 minutes, resumable
	$(PY) -m vsp.study --out "$(OUT)" --jobs $(or $(DASK),$(JOBS))

beyond: venv ## our own method and others beside it, into data/results/: 1 to 1.5 HOURS, resumable
	$(PY) -m vsp.beyond --out "$(OUT)" --jobs $(or $(DASK),$(JOBS))

beyond-long: venv ## the same for LunarLander, whose physics engine is slow: 3 to 4 HOURS, resumable
	$(PY) -m vsp.beyond --long --out "$(OUT)" --jobs $(or $(DASK),$(JOBS))

lookup: venv ## times of look-ups and neighbour graphs in many dimensions, into data/results/: about 3 minutes
	$(PY) -m vsp.lookup_study --out "$(OUT)"

teachers: venv ## trains the TD3 teachers from scratch: 5 to 6 HOURS; resumes from $VSP_CACHE (~/.cache/vsp) if stopped
	$(PY) -m vsp.training --cache "$${VSP_CACHE:-$$HOME/.cache/vsp}" --out "$(OUT)/data/teachers"

short-teachers: venv ## trains the further teachers that `make study` compares: 1 to 2 HOURS; resumes likewise
	$(PY) -m vsp.training --short --cache "$${VSP_CACHE:-$$HOME/.cache/vsp}" --out "$(OUT)/data/teachers"

manifest: venv ## lists the files of data/ as they are, for somebody who changed one on purpose: at once
	@$(PY) -m vsp.manifest

lab: venv ## opens JupyterLab on the notebooks
	$(PY) -m jupyterlab notebooks

test: venv ## runs the tests, several at a time: about 3 minutes
	@MPLBACKEND=Agg $(PY) -m pytest -q -rs -n logical --maxprocesses 4 --dist worksteal tests

# Figures go to data/results/ and the README when all is measured, for notebook 07 shows them and tests look at notebooks;
# what did not hold (pytest's status 1) goes there too.
MEASURED = $(OUT)/build/measured
PUBLISH = $(PY) tests/measured.py "$(MEASURED)" "$(OUT)/data/results" README.md

bench: venv ## measures speed and scale, into data/results/: an HOUR or more, on a machine that does nothing else
	@MPLBACKEND=Agg $(PY) -m pytest -q tests/bench --record "$(MEASURED)"; status=$$?; test $$status -le 1 && \
	  $(PY) -m vsp.scale_study --out "$(OUT)" && $(PUBLISH) && exit $$status

torture: venv ## breaks it in every way we know, into data/results/: 3 HOURS or more; kills resume
	@MPLBACKEND=Agg $(PY) -m pytest -q tests/torture --record "$(MEASURED)"; status=$$?; test $$status -le 1 && \
	  $(PUBLISH) && exit $$status

clean: ## removes build/ (but build/course, where somebody may have written) and data/runs/: at once
	@test ! -d "$(OUT)/build" || find "$(OUT)/build" -mindepth 1 -maxdepth 1 ! -name course -exec rm -rf {} +
	rm -rf "$(OUT)/data/runs"
	@for d in figures data; do test ! -d "$(OUT)/$$d" || find "$(OUT)/$$d" -type f -name '.?*-????????.*' -delete; done

# Notebooks

# $(1): a notebook. Its state is what it reads, as found before the run, and what it makes, as found after.
define notebook-rules
.PHONY: $(call outputs,$(1))
$(call outputs,$(1)): $(1) ;
$(1): venv $(if $(filter $(1),$(NEED_RUNS)),runs)
	@mkdir -p "$$(STATE)"; for file in $$(READS_$(1)); do test -f "$$$$file" || { \
	  echo "error: $$$$file is missing: \`git checkout $$$$file\` brings it back; \`make study beyond beyond-long lookup bench torture\` makes all such files" >&2; exit 1; }; done; \
	inputs=$$$$(cksum $$(INPUTS) notebooks/$(1).ipynb $$(READS_$(1)) $(if $(filter $(1),$(NEED_RUNS)),"$$(STATE)/runs")) || exit 1; \
	state() { echo "$$$$inputs quick=$$(QUICK)"; (cd "$$(OUT)" && cksum $(call outputs,$(1)) 2>/dev/null); }; \
	if ! state | cmp -s - "$$(STATE)/$(1)"; then \
	  $$(PY) -m vsp.runner notebooks/$(1).ipynb --out "$$(OUT)" $$(if $$(QUICK),-p quick true) \
	    --expect $(call outputs,$(1)) && state > "$$(STATE)/$(1)" && echo $(1) >> "$$(STATE)/made"; fi
endef
$(foreach n,$(NOTEBOOKS),$(eval $(call notebook-rules,$(n))))

# The course

course: venv ## three lessons: a hand-out for students, solutions and the lecturer's guide, into build/course/: 3 s
	@$(PY) -m vsp.course.build --out "$(OUT)"

# The site

SITE = $(OUT)/build/site

# The pages are laid out as the repository is, so that a link of the README leads to the same thing on the site. The old
# site stays until the new one is whole.
site: venv-site ## the companion as pages for a browser, into build/site/: about a minute
	@$(PY) -m vsp.course.pages --out "$(OUT)"
	@rm -rf "$(SITE)-work"; source="$(SITE)-work/source"; \
	mkdir -p "$$source/notebooks/course" "$$source/figures" "$$source/data"; \
	cp -R docs/*.md docs/api README.md CITATION.cff "$$source"; \
	cp figures/executed/*.ipynb "$$source/notebooks"; \
	cp -R figures/*.* figures/tables "$$source/figures"; \
	cp data/README.md "$$source/data"; \
	cp "$(OUT)"/build/course/pages/*.ipynb "$$source/notebooks/course"
	@$(PY) -m sphinx -q -W -E -c docs -d "$(SITE)-work/doctrees" \
	  "$(SITE)-work/source" "$(SITE)-work/pages"
	@rm -rf "$(SITE)"; mv "$(SITE)-work/pages" "$(SITE)"; rm -r "$(SITE)-work"; echo "made: open $(SITE)/index.html"

test-site: site ## looks at the site and at JupyterLab in a browser, which needs Chromium: about 6 minutes
	@SITE="$(SITE)" MPLBACKEND=Agg $(PY) -m pytest -q -rs tests/site

# Set-up

# vsp/environment.py says what in .venv is not as it was when its set-up ended; this, where not even that runs.
AS_BUILT = $(PY) -X utf8 -I vsp/environment.py

venv:
	@$(AS_BUILT) 2>/dev/null || exec $(MAKE) --no-print-directory new-venv

# torch first, and by itself: pip takes the CPU build where it is pointed to one, else the registry's; the lock knows
# the checksums of both. Only the GPU libraries that the registry's Linux builds ask for come without a checksum, in the
# versions that torch asks for. vsp itself is found through a path file, so that edits count at once; Python reads such
# files in the locale's encoding, hence a relative path.
new-venv:
	@python=; for p in $(if $(PYTHON),"$(PYTHON)",python3.11 python3); do \
	  if "$$p" -c 'import ensurepip, sys; sys.exit(sys.version_info[:2] != (3, 11))' 2>/dev/null; then \
	    python=$$p; break; fi; done; \
	if [ -z "$$python" ]; then \
	  echo 'error: tried $(if $(PYTHON),$(PYTHON),python3.11 and python3), expected Python 3.11 with venv' >&2; \
	  echo '  (Debian: apt install python3.11-venv). To say where it is: make PYTHON=/path/to/python3.11' >&2; \
	  exit 1; fi; \
	exec 9> .venv.lock; lock() { "$$python" -c "import fcntl; fcntl.flock(9, fcntl.LOCK_EX | $$1)" 2>/dev/null; }; \
	if ! lock fcntl.LOCK_NB; then \
	  echo 'another make is setting up .venv: waiting for it to end' >&2; lock 0; fi; \
	if [ -e .venv ]; then \
	  if why=$$($(AS_BUILT) 2>&1); then exit 0; fi; \
	  if $(PY) -c '' 2>/dev/null; then :; else why='its Python does not run'; fi; \
	  echo ".venv is not what environment.lock says: $$why"; fi; \
	trap 'test $$? -eq 0 || echo "$$advice" >&2' EXIT; trap 'exit 1' HUP INT TERM; set -e; \
	advice='error: .venv is not whole, and the next make begins anew; after edits, `git checkout environment.lock`'; \
	echo "Setting up .venv from environment.lock with $$python; this happens once and takes about 2 minutes,"; \
	echo "longer where torch brings GPU libraries along (Linux, 2.5 GB of downloads)."; \
	rm -rf .venv; "$$python" -m venv .venv; \
	torch=$$(sed -n 's/^\(torch==[0-9.]*\).*/\1/p' environment.lock); \
	echo "1/4 $$torch"; \
	$(PIP) download -qq --no-deps --dest .venv/torch "$$torch"; \
	if ! grep -qF -e "$$($(PIP) hash .venv/torch/*.whl | tail -n 1)" environment.lock; then \
	  echo "error: SHA-256 of $$(ls .venv/torch) is not among those of $$torch in environment.lock" >&2; \
	  echo "  pip was pointed to another build: unset its settings (PIP_..., pip.conf) for packages" >&2; exit 1; fi; \
	$(PIP) install -qq --no-deps .venv/torch/*.whl; rm -r .venv/torch; \
	echo "2/4 the other packages"; \
	$(PIP) install -qq --no-deps --require-hashes --requirement environment.lock; \
	echo "3/4 what torch needs on this machine"; \
	$(PIP) install -qq "$$torch"; \
	echo ../../../.. > "$$($(PY) -c 'import sysconfig; print(sysconfig.get_path("purelib"))')/vsp.pth"; \
	echo "4/4 check"; \
	$(PIP) check; \
	$(PY) -c 'import matplotlib.font_manager'; \
	$(AS_BUILT) --built

# What only the site and its tests need goes into the same .venv when it is first asked for; a new .venv forgets it.
venv-site: venv
	@cksum docs/environment.lock | cmp -s - .venv/site-built-from || { set -e; \
	echo "Adding the packages of docs/environment.lock to .venv; this happens once and takes about half a minute."; \
	rm -f .venv/site-built-from; \
	$(PIP) install -qq --no-deps --require-hashes --requirement docs/environment.lock; \
	$(PIP) check; \
	cksum docs/environment.lock > .venv/site-built-from; }

# SHA-256 of a CPU build of torch (2.13.0+cpu, Python 3.11, Linux x86_64), accepted beside the registry's builds.
TORCH_CPU := 6746dbcbeb526eb61330b76b41ff1b4eb848951103a892eeb080dfa2b264667b
ANYWHERE := ; python_full_version < '3.12' and (sys_platform == 'darwin' or sys_platform == 'linux')

UV := build/uv/bin/uv
RESOLVE := $(UV) pip compile -q --universal --generate-hashes --python-version 3.11 --extra test --no-annotate --no-header

lock: venv ## resolves pyproject.toml and docs/requirements.in anew, to the newest versions: under a minute
	@mkdir -p build; test -x $(UV) || { $(PY) -m venv build/uv && build/uv/bin/python -m pip install -qq uv; }
	@$(RESOLVE) --output-file build/resolved.lock pyproject.toml
	@{ echo '# The whole environment with the checksums of every file, for Linux and macOS: written by `make lock`.'; \
	  sed "s/ $(ANYWHERE)//" build/resolved.lock \
	  | awk '{ print } /^torch==/ { print "    --hash=sha256:$(TORCH_CPU) \\" }'; } > build/environment.lock
	@rm build/resolved.lock; mv build/environment.lock environment.lock; \
	  echo "environment.lock: $$(grep -c '^[a-z]' environment.lock) packages"
	@$(MAKE) --no-print-directory lock-site

# Only what environment.lock lacks, resolved to go with it.
lock-site:
	@$(RESOLVE) --constraints environment.lock --output-file build/resolved.lock pyproject.toml docs/requirements.in
	@{ echo '# What the site needs beside environment.lock, with checksums, for Linux and macOS: written by `make lock`.'; \
	  sed "s/ $(ANYWHERE)//" build/resolved.lock \
	  | awk -F== 'NR == FNR { known[$$1] = /^[a-z]/; next } /^[a-z]/ { fresh = !known[$$1] } fresh' environment.lock -; } \
	  > build/environment.lock
	@rm build/resolved.lock; mv build/environment.lock docs/environment.lock; \
	  echo "docs/environment.lock: $$(grep -c '^[a-z]' docs/environment.lock) packages more"
