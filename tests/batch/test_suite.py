"""Suite files: every field checked, every fault named with what is near."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from vehnav.batch.fields import fraction_of, size_of
from vehnav.batch.places import expanded, folder_name
from vehnav.batch.suite import Bar, load_suite
from vehnav.errors import ConfigError

WHOLE = """
[suite]
name = "all of it"
time_limit = 30
memory_limit = "1.5G"
keep = "trajectory"

[[log]]
path = "drives/*.csv"
group = "drives"
axes = "FRD"
mount = [1, 2, 3.5]
gps_file = "gps.pos"

[[log]]
path = "${VEHNAV_NO_SUCH:-other}/town.mcap"
name = "the town"

[[log]]
path = "absent/*.mcap"
optional = true

[[log]]
scenario = "city,duration=200"
group = "sim"
name = "city"
seed = 8
runs = 3
wheel = true
outage = ["20:30"]

[[config]]
name = "default"

[[config]]
name = "aided"
method = "filter"
gps = "aid"
aid = "zupt,nhc"
outage = ["every=180,length=60,from=60"]

[[config]]
name = "from a file"
file = "better.toml"
stop_dwell = 2

[[bar]]
metric = "errors.horizontal_m.max"
max = 100

[[bar]]
group = "sim"
config = "default"
metric = "stops.count"
min = 2

[baseline]
file = "base/line.json"
max_regression = "5%"
max_log_regression = 0.5
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for name in ("drives/b.csv", "drives/a.csv", "drives/a.gps.csv", "drives/a.truth.csv",
                 "other/town.mcap"):  # fmt: skip
        path = tmp_path / name
        path.parent.mkdir(exist_ok=True)
        path.write_text("x")
    (tmp_path / "better.toml").write_text(
        "[method]\nno_levelling = true\n[stops]\nstop_dwell = 9\n[output]\noutput_rate = 1\n"
    )
    return tmp_path


def load(folder: Path, text: str):
    path = folder / "suite.toml"
    path.write_text(text)
    return load_suite(path)


def test_all_of_it(folder) -> None:
    suite = load(folder, WHOLE)
    assert suite.name == "all of it"
    assert (suite.time_limit, suite.memory_limit, suite.keep) == (30.0, 3 * 2**29, "trajectory")
    names = [(log.name, log.group) for log in suite.logs]
    assert names == [
        ("a", "drives"), ("b", "drives"), ("the_town", ""),
        ("city-08", "sim"), ("city-09", "sim"), ("city-10", "sim"),
    ]  # fmt: skip
    first, town, city = suite.logs[0], suite.logs[2], suite.logs[4]
    assert first.source == str(folder / "drives/a.csv")
    assert first.shown == "drives/a.csv"
    assert first.options == {
        "axes": "FRD", "mount": (1.0, 2.0, 3.5), "gps_file": str(folder / "gps.pos"),
    }  # fmt: skip
    assert town.source == str(folder / "other/town.mcap")
    assert city.simulation is not None
    assert (city.simulation.seed, city.simulation.outage) == (9, ("20:30",))
    assert suite.skipped == ("absent/*.mcap: not there",)
    assert suite.configs[1].options["aid"] == ("zupt", "nhc")
    assert suite.configs[2].options == {"levelling": False, "stop_dwell": 2.0}
    assert suite.bars[1] == Bar("stops.count", "min", 2.0, "sim", None, "default")
    assert suite.baseline.file == folder / "base/line.json"
    assert (suite.baseline.max_regression, suite.baseline.max_log_regression) == (0.05, 0.5)
    assert "errors.horizontal_m.max" in suite.metrics


def test_a_log_may_run_with_some_configurations_only(folder) -> None:
    text = LOG + "configs = ['b', 'the a']\n[[log]]\npath = 'drives/b.csv'\n"
    suite = load(folder, text + "".join(f"[[config]]\nname = '{x}'\n" for x in ("the a", "b", "c")))
    pairs = [(log.name, config.name) for log, config in suite.matrix()]
    assert pairs == [("a", "the_a"), ("b", "the_a"), ("a", "b"), ("b", "b"), ("b", "c")]


def test_one_configuration_is_there_by_itself(folder) -> None:
    suite = load(folder, '[suite]\nname = "s"\n[[log]]\npath = "drives/a.csv"\n')
    assert [(config.name, dict(config.options)) for config in suite.configs] == [("default", {})]


HEAD = '[suite]\nname = "s"\n'
LOG = HEAD + '[[log]]\npath = "drives/a.csv"\n'


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (LOG + "[sute]", "unknown key 'sute'; did you mean 'suite'"),
        ("[suite]\n[[log]]\npath='drives/a.csv'", r"\[suite\]: no name"),
        (HEAD, r"no \[\[log\]\]"),
        ("log = 3\n" + HEAD, "must be written"),
        ("[suite]\nname = 3\n[[log]]\npath='drives/a.csv'", "name: expected a text, not 3"),
        ("[suite]\nname='s'\ntime_limit=0", "time_limit: expected a number above 0"),
        ("[suite]\nname='s'\nmemory_limit='much'", "memory_limit: expected a size such as"),
        ("[suite]\nname='s'\nkeep='all'", "keep: expected one of figures, report, trajectory"),
        (HEAD + "[[log]]\npth='x'", "expected either path or scenario"),
        (LOG + "prset = 'x'", r"\[\[log\]\] 1 \(drives/a.csv\): unknown key 'prset'; did you mean"
                              " 'preset'"),
        (LOG + "axes = 5", r"\[\[log\]\] 1 \(drives/a.csv\) axes: expected a text, not 5"),
        (LOG + "mount = [1, 2]", "mount: expected an array of 3 numbers"),
        (LOG + "max_gap = true", "max_gap: expected a number, not True"),
        (LOG + "split = true", "unknown key 'split'"),
        (LOG + "gps_time_offset = 'later'", "expected a number or 'auto'"),
        (LOG + "start = 5\nend = 2", "--end 2 is not after --start 5"),
        (HEAD + "[[log]]\npath='nothing/*.mcap'", "nothing/[*].mcap: matches nothing in .*"
                                                  "optional = true"),
        (HEAD + "[[log]]\npath='no.mcap'", "no.mcap: no such file or folder"),
        (HEAD + "[[log]]\npath='${VEHNAV_NO_SUCH}/x.mcap'", "the environment has no VEHNAV_NO_S"),
        (HEAD + "[[log]]\npath='drives/*.csv'\nname='x'", "2 logs match the pattern"),
        (LOG + "[[log]]\npath='./drives/a.csv'", "two .* are called 'a' .*name of its own"),
        (HEAD + "[[log]]\nscenario='citty'", "no scenario 'citty'; did you mean 'city'"),
        (HEAD + "[[log]]\nscenario='city'\nsensor='hg17'", "hg1700"),
        (HEAD + "[[log]]\nscenario='city'\nrte=50", "unknown key 'rte'; did you mean 'rate'"),
        (HEAD + "[[log]]\nscenario='city'\nruns=0", "runs must be at least 1"),
        (LOG + "configs = ['defalt']", "no configuration 'defalt'; did you mean 'default'"),
        (LOG + "configs = 3", "configs: expected an array of texts"),
        (LOG + "[[config]]\nmethod='free'", r"\[\[config\]\] 1: no name"),
        (LOG + "[[config]]\nname='x'\nmethod='fre'", "method: expected one of stops, free"),
        (LOG + "[[config]]\nname='x'\nmethd='free'", "unknown key 'methd'; did you mean 'method'"),
        (LOG + "[[config]]\nname='x'\ngps='aid'", "belong to --method filter"),
        (LOG + "[[config]]\nname='x'\n[[config]]\nname='X'", "two .*config.* are called 'X'"),
        (LOG + "[[config]]\nname='x'\nfile='no.toml'", "no.toml: not a readable config"),
        (LOG + "[[bar]]\nmetric='errors.up_m.max'", "either max or min"),
        (LOG + "[[bar]]\nmetric='errors.up_m.max'\nmax=1\nmin=0", "either max or min"),
        (LOG + "[[bar]]\nmetric='horizontal'\nmax=1", "expected a dotted path"),
        (LOG + "[[bar]]\nmetric='errors.horizontal.max'\nmax=1", "did you mean 'horizontal_m'"),
        (LOG + "[[bar]]\nmetric='errors.up_m.p59'\nmax=1", "did you mean 'p95'"),
        (LOG + "[[bar]]\nmetric='error.up_m.max'\nmax=1", "did you mean 'errors'"),
        (LOG + "[[bar]]\nmetric='errors.up_m.max'\nmax='1'", "max: expected a number, not '1'"),
        (LOG + "[[bar]]\ngroup='x'\nmetric='errors.up_m.max'\nmax=1", "there is no group 'x'$"),
        (LOG + "group='city'\n[[bar]]\ngroup='cty'\nmetric='errors.up_m.max'\nmax=1",
         "there is no group 'cty'; did you mean 'city'"),
        (LOG + "group='a'\n[[log]]\npath='drives/b.csv'\ngroup='b'\nname='other'\n"
         "[[bar]]\ngroup='a'\nlog='other'\nmetric='errors.up_m.max'\nmax=1",
         "group 'a' and log 'other' never meet"),
        (LOG + "[baseline]\nmax_regression='some'", "max_regression: expected a share such as 5%"),
        (LOG + "[baseline]\nfle='x'", "unknown key 'fle'; did you mean 'file'"),
        ("[suite", "not a TOML file"),
    ],
)  # fmt: skip
def test_faults_are_named(folder, text, message) -> None:
    with pytest.raises(ConfigError, match=message) as caught:
        load(folder, text)
    assert "suite.toml" in str(caught.value)


def test_a_suite_that_is_not_there(tmp_path) -> None:
    with pytest.raises(ConfigError, match=r"cannot be read.*--init DIR writes a first suite"):
        load_suite(tmp_path / "suite.toml")
    with pytest.raises(ConfigError, match="a folder; vehnav score --init"):
        load_suite(tmp_path)


def test_a_bar_for_what_was_skipped_is_no_fault(folder) -> None:
    text = HEAD + "[[log]]\npath='no.mcap'\ngroup='g'\noptional=true\n"
    suite = load(folder, text + "[[bar]]\ngroup='g'\nmetric='errors.up_m.max'\nmax=1\n")
    assert suite.logs == ()
    assert len(suite.bars) == 1


def test_names_take_as_many_folders_as_they_need(folder) -> None:
    for name in ("mon/drive.mcap", "tue/drive.mcap"):
        (folder / name).parent.mkdir()
        (folder / name).write_text("x")
    suite = load(folder, HEAD + "[[log]]\npath='*/drive.mcap'\n")
    assert [log.name for log in suite.logs] == ["mon-drive", "tue-drive"]


def test_a_pattern_in_a_store(folder) -> None:
    fsspec = pytest.importorskip("fsspec")
    store = fsspec.filesystem("memory")
    store.pipe({"/fleet/one/a.mcap": b"x", "/fleet/two/a.mcap": b"x", "/fleet/two/b.txt": b"x"})
    suite = load(folder, HEAD + "[[log]]\npath='memory://fleet/**/*.mcap'\n")
    assert [log.name for log in suite.logs] == ["one-a", "two-a"]
    assert [log.source for log in suite.logs] == [
        "memory:///fleet/one/a.mcap", "memory:///fleet/two/a.mcap",
    ]  # fmt: skip


def test_sizes_and_shares() -> None:
    assert size_of("512M", "x") == 512 * 2**20
    assert size_of("2 GiB", "x") == 2 * 2**30
    assert size_of(1000, "x") == 1000
    assert fraction_of("0.5 %", "x") == 0.005
    assert fraction_of(0, "x") == 0.0
    assert fraction_of("200%", "x") == 2.0
    for bad in ("-5%", "five", True, "5", 5):
        with pytest.raises(ConfigError):
            fraction_of(bad, "x")


def test_names_and_environment(monkeypatch) -> None:
    monkeypatch.setenv("VEHNAV_THERE", "here")
    assert expanded("${VEHNAV_THERE}/${VEHNAV_NO_SUCH:-or/else}") == "here/or/else"
    assert folder_name("../a b/..") == "a_b"
    assert folder_name("..") == "log"


def test_the_process_that_hands_out_loads_no_compiler(folder) -> None:
    """Its workers need numba and start the later the longer it takes to load its own."""
    path = folder / "suite.toml"
    path.write_text(
        HEAD + "[[log]]\npath='a.csv'\noptional=true\n"
        "[[bar]]\nmetric='errors.horizontal_m.max'\nmax=3.0\n"
    )
    code = (
        "import sys; from vehnav.batch.suite import load_suite; load_suite(sys.argv[1]);"
        "import vehnav.batch.runner, vehnav.batch.index, vehnav.batch.regression;"
        "print({'numba', 'pandas', 'vehnav.pipeline'} & set(sys.modules))"
    )
    found = subprocess.run(
        [sys.executable, "-c", code, str(path)], capture_output=True, text=True, check=True
    )
    assert found.stdout.strip() == "set()"
