# Every target makes the virtual environment it needs; PYTHON picks the interpreter (3.11 or newer).
PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin
INSTALLED := $(VENV)/.installed

.PHONY: demo test test-flights test-computing test-long test-long-flights test-long-computing lint docs bench bench-loop faults autopilots papers hidden decision-rule tutorial real nanobench
.PHONY: faults-random faults-random-mavlink sensor-cases sensor-figure tracking architecture sitl-check screenshots clean

demo: $(INSTALLED)
	$(BIN)/quadctl demo

# A test run starts many processes: what the first compiles, the others read, even where the environment forbids it.
test test-flights test-computing test-long test-long-flights test-long-computing: export PYTHONDONTWRITEBYTECODE :=

# Both at the same time: flights mostly wait, and computing, which gives way to them, uses what they leave.
test: $(INSTALLED)
	@$(MAKE) --no-print-directory --jobs=2 --keep-going --output-sync=target test-flights test-computing

# What fails beside other flights is flown again alone: a busy machine can spoil a flight in real time.
FLIGHTS = $(BIN)/python -m pytest tests/realtime -o cache_dir=.pytest_cache/flights
AGAIN = --last-failed --last-failed-no-failures none
test-flights: $(INSTALLED)
	$(FLIGHTS) -m "not long" -n 4 --dist loadfile --no-loadscope-reorder || $(FLIGHTS) -m "not long" $(AGAIN)

# A process for each core: none needs more than a thread.
test-computing test-long-computing: export OPENBLAS_NUM_THREADS := 1
test-computing: $(INSTALLED)
	nice -n 10 $(BIN)/python -m pytest -m "not long" --ignore=tests/realtime -n 2 --dist loadfile --no-loadscope-reorder

# Journeys through a page and checks of a study that would double the time of `make test`; CI runs them, too.
test-long: $(INSTALLED)
	@$(MAKE) --no-print-directory --jobs=2 --keep-going --output-sync=target test-long-flights test-long-computing

test-long-flights: $(INSTALLED)
	$(FLIGHTS) -m long || $(FLIGHTS) -m long $(AGAIN)

# Three at once: a browser is often waited for. What shares a server, or flights, runs in one process; a test may
# wait for flights in real time, which it gives way to, and those of pages come last.
test-long-computing: $(INSTALLED)
	nice -n 10 $(BIN)/python -m pytest -m "long and not real" -n 3 --dist loadscope --no-loadscope-reorder --ignore=tests/realtime --timeout 1200

lint: $(INSTALLED)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy quadctl studies
	$(BIN)/lint-imports

bench: $(INSTALLED)
	$(BIN)/python -m studies.benchmarks.run

# The control loop alone, for some 20 minutes: nothing else should run meanwhile. Writes docs/control-loop.md.
bench-loop: $(INSTALLED)
	$(BIN)/python -m studies.benchmarks.control_loop --out docs/control-loop.md

# Every fault on every autopilot, in real time; writes docs/faults.md, or FAULTS_PAGE. Some four minutes.
faults: FAULTS_PAGE ?= docs/faults.md
faults: $(INSTALLED)
	$(BIN)/python -m studies.faults --out $(FAULTS_PAGE)

# Random sequences of two to four faults: N flights from seed FIRST on, in simulated time, or over MAVLink in real time.
faults-random faults-random-mavlink: FIRST ?= 0
faults-random: N ?= 1000
faults-random: $(INSTALLED)
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m studies.random_faults -n $(N) --from $(FIRST)

faults-random-mavlink: N ?= 100
faults-random-mavlink: $(INSTALLED)
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m studies.random_faults -n $(N) --from $(FIRST) --over mavlink

# The simulated autopilots beside the recordings of real ones, in ../shared; writes docs/autopilots.md.
autopilots: $(INSTALLED)
	$(BIN)/python -m studies.autopilots

# Both sets of seeds: the one that the lab was tuned on, and the one that is run for the report only.
hidden: $(INSTALLED)
	$(BIN)/python -m studies.blind_cases.scoreboard --set tuning
	$(BIN)/python -m studies.blind_cases.scoreboard --set final

# Hidden errors of a barometer, by the command line; writes docs/sensor-cases.md. Some ten minutes.
sensor-cases: $(INSTALLED)
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m studies.sensor_cases --out docs/sensor-cases.md

# The figure of docs/sensors.md, from a real log beside this folder.
sensor-figure: $(INSTALLED)
	$(BIN)/quadctl diagnose --sensors ../shared/data/real/ardupilot47/baro_wcf.bin --plot docs/sensors.png

# Flights by the control law, by the one before and by the autopilots' own; writes docs/tracking.md. Some twelve minutes.
tracking: $(INSTALLED)
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m studies.tracking

# Moves every threshold of the decision rule; writes docs/decision-rule.md. Some twenty minutes.
decision-rule: $(INSTALLED)
	$(BIN)/python -m studies.decision_rule

papers: $(INSTALLED)
	$(BIN)/python -m studies.papers

# Runs every command of docs/find-the-missing-effect.md and writes the page with what they print.
tutorial: $(INSTALLED)
	$(BIN)/python -m studies.tutorial

# What is found in public logs of real flights, and whether that is what is known to be there.
real: $(INSTALLED)
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pytest tests/lab/test_real_logs.py -n 2
	$(BIN)/python -m studies.real_flights

# Rollouts of the whole state on a public benchmark, in ../shared; writes docs/benchmarks-public.md.
nanobench: $(INSTALLED)
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m studies.nanobench ../shared/data/nanobench

# The documentation as a site, in build/site, without network; a link that leads nowhere fails (not with --quiet).
docs: $(VENV)/.docs
	$(BIN)/python -m studies.site_pages
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --clean
	@echo "open build/site/index.html"

# The pictures and tables of docs/architecture.md, from the imports of the code.
architecture: $(INSTALLED)
	$(BIN)/python -m studies.architecture

# Pictures of the lab page (docs/lab-page.md) and of the live view, at both sizes, light and dark, in build/screenshots, and how fast the page is; needs Chromium.
screenshots: $(INSTALLED)
	SCREENSHOTS=all $(BIN)/python -m pytest tests/web/test_lab_page.py tests/web/test_analysed_flight.py tests/web/test_further_flights.py tests/realtime/test_view_page.py -s

# Flies real autopilots that are there and prints a table: make sitl-check PX4=DIRECTORY ARDUPILOT=DIRECTORY [FRAME=hexa] (or LINK=URL).
sitl-check: export QUADCTL := $(abspath $(BIN))/quadctl
sitl-check: $(INSTALLED)
	@PX4="$(PX4)" ARDUPILOT="$(ARDUPILOT)" LINK="$(LINK)" CONFIG="$(CONFIG)" FRAME="$(or $(FRAME),quad)" sitl/check.sh

clean:
	rm -rf $(VENV) build demo *.egg-info .mypy_cache .pytest_cache .ruff_cache .hypothesis .import_linter_cache

$(INSTALLED): pyproject.toml constraints.txt
	$(PYTHON) -c "import sys; sys.exit(sys.version_info < (3, 11) and 'quadctl needs Python 3.11 or newer')"
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --upgrade --constraint constraints.txt pip
	$(BIN)/python -m pip install --quiet --constraint constraints.txt --editable ".[all]"
	touch $@

$(VENV)/.docs: $(INSTALLED)
	$(BIN)/python -m pip install --quiet --constraint constraints.txt --editable ".[docs]"
	touch $@
