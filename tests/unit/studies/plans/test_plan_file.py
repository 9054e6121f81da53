"""Plans: what they mean, and every way to get one wrong, all said at once."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from tests.unit.studies.tiny import write_dataset

from retraverse.errors import DataMissingError
from retraverse.images import Encoder, VideoGroups, Worsening
from retraverse.images.jpeg_parts import JPEG_PARTS
from retraverse.images.quantisation import STANDARD_TABLES
from retraverse.studies.plans.plan import StudyPlan, TechniqueChoice, compression_pairs
from retraverse.studies.plans.plan_checks import plan_problems
from retraverse.studies.plans.plan_file import PlanError, load_plan, read_plan
from retraverse.studies.plans.tables_file import save_tables
from retraverse.techniques.sending import coding, coding_label


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("data")
    write_dataset(folder / "noise", n_frames=12)
    return folder


def plan_of(data: Path, lines: str, **options: Any) -> StudyPlan:
    text = f'data = "{data}"\n{lines}'
    for key, value in (("datasets", '["noise"]'), ("techniques", '["hog"]')):
        if f"{key} =" not in lines:
            text = f"{key} = {value}\n{text}"
    return read_plan(text, **options)


def test_the_least_a_plan_needs(data: Path) -> None:
    plan = plan_of(data, "")
    assert (plan.n_runs, plan.sequence_lengths, plan.seeds) == (1, (1,), (0,))
    assert plan.pairs[0].query.is_nothing
    assert plan.matchers[0].label == "mean"


def test_the_grid(data: Path) -> None:
    plan = plan_of(
        data,
        """
        techniques = ["gist", { name = "hog", sequence_lengths = [2], matchers = ["seqslam"] }]
        matchers = ["mean", { name = "hmm", sequence_lengths = [5] }]
        sequence_lengths = ["1..3", "dynamic", 3]
        seeds = [1, 2]
        images = { resize = [0, 64], resizer = "opencv", encoders = [{}, { optimize = true }] }
        compression = { levels = ["none", 50], pairs = ["uniform", "query"], other = "none" }
        """.replace('"mean", {', '{ name = "mean" }, {'),
    )
    # Pictures as they are come once, whatever the encoder: (none, 50+, 50o) x query (50+, 50o).
    assert len(plan.pairs) == 2 * 5
    lengths = [length for _, length in plan.settings(plan.techniques[0])]
    assert lengths == [1, 2, 3, "dynamic", 5]
    assert [(m.name, k) for m, k in plan.settings(plan.techniques[1])] == [("seqslam", 2)]
    assert plan.n_runs == 10 * (5 + 1) * 2


@pytest.mark.parametrize(
    ("rules", "expected"),
    [
        (("uniform",), [(0, 0), (9, 9)]),
        (("query",), [(0, 5), (9, 5)]),
        (("reference",), [(5, 0), (5, 9)]),
        (("grid",), [(0, 0), (0, 9), (9, 0), (9, 9)]),
        (("uniform", "grid"), [(0, 0), (9, 9), (0, 9), (9, 0)]),
    ],
)
def test_compression_pairs(rules: tuple[str, ...], expected: list[tuple[int, int]]) -> None:
    assert list(compression_pairs((0, 9), rules, 5)) == expected  # type: ignore[arg-type]


def test_query_and_map_levels_of_their_own(data: Path) -> None:
    plan = plan_of(data, 'compression = { query = [0, 50], reference = ["none", 90, 99] }')
    pairs = [(pair.query.compression, pair.reference.compression) for pair in plan.pairs]
    assert pairs == [(0, None), (0, 90), (0, 99), (50, None), (50, 90), (50, 99)]


def test_parts_of_jpeg_need_a_compression(data: Path) -> None:
    lines = 'compression = { levels = ["none", 97], parts = ["whole", "grid"] }'
    ways = [(pair.query, pair.reference) for pair in plan_of(data, lines).pairs]
    assert all(query == reference for query, reference in ways)
    assert [(way.compression, way.part) for way, _ in ways] == [(None, ""), (97, ""), (97, "grid")]
    every = plan_of(data, 'compression = { levels = [97], parts = ["every"] }').pairs
    assert [pair.query.part for pair in every] == ["", *JPEG_PARTS]


def test_video_is_sent_beside_jpeg_files(data: Path) -> None:
    pytest.importorskip("av", reason="the extra 'video' is not installed")
    lines = """
        images = { resize = [64] }
        compression = { query = [50], reference = ["none"] }
        video = { h265 = [30, 40], av1 = [50], group = 4 }
        """
    pairs = plan_of(data, lines).pairs
    assert [pair.query.video for pair in pairs] == [
        None,
        VideoGroups("h265", 30, 4),
        VideoGroups("h265", 40, 4),
        VideoGroups("av1", 50, 4),
    ]
    assert {pair.reference for pair in pairs} == {Worsening(64)}


def test_what_is_sent_is_the_plans_or_the_techniques_own(data: Path) -> None:
    plan = plan_of(
        data,
        """
        techniques = ["hog", { name = "patchnorm", sent = ["exact"] }]
        sent = ["pictures", "int8", { name = "sketch", parameters = { bits = 64 } }, "int8"]
        sequence_lengths = [1, 2]
        """,
    )
    names = [
        [None if one is None else coding_label(one) for one in plan.sent_by(technique)]
        for technique in plan.techniques
    ]
    assert names == [[None, "int8", "sketch(bits=64)"], ["exact"]]
    assert plan.n_runs == 2 * (3 + 1)


@pytest.mark.parametrize(
    ("sent", "problem"),
    [
        ((), "sent: got nothing, expected at least one, each once"),
        ((coding("int8"), coding("int8")), "sent: got int8, int8, expected at least one"),
        (("exact",), "sent: got 'exact', expected what retraverse.techniques.sending.coding"),
    ],
)
def test_what_is_sent_by_a_plan_made_in_python(data: Path, sent: Any, problem: str) -> None:
    plan = replace(plan_of(data, ""), sent=sent)
    assert [problem in line for line in plan_problems(plan)] == [True]


def test_a_parameter_follows_the_size_of_the_pictures(data: Path) -> None:
    technique = '{ name = "hog", parameters = { form = "chapter7", resolution = "resized" } }'
    plan = plan_of(data, f"techniques = [{technique}]\nimages = {{ resize = [16, 64] }}")
    sizes = [plan.techniques[0].at(pair.query.resize).make() for pair in plan.pairs]
    assert [made.parameters.resolution for made in sizes] == [16, 64]
    with pytest.raises(PlanError, match="the pictures are not resized"):
        plan_of(data, f"techniques = [{technique}]")


def test_datasets_of_ones_own(data: Path) -> None:
    own = '{ name = "mine", query = "noise/query", reference = "noise/reference", tolerance = 1 }'
    plan = read_plan(f'datasets = ["noise", {own}]\ntechniques = ["hog"]', root=data)
    assert [dataset.truth().tolerance_frames for dataset in plan.datasets] == [2, 1]


def test_every_dataset_at_every_speed(data: Path) -> None:
    plan = plan_of(data, 'speeds = ["constant", "stops", "constant", "jump"]')
    names = [dataset.name for dataset in plan.datasets]
    assert names == ["noise", "noise, with stops", "noise, with jumps"]
    assert plan.n_runs == 3


def test_a_drive_too_short_for_another_speed(tmp_path: Path) -> None:
    write_dataset(tmp_path / "noise", n_frames=9)
    assert plan_of(tmp_path, "").n_runs == 1
    with pytest.raises(PlanError) as raised:
        plan_of(tmp_path, 'speeds = ["constant", "varying"]')
    (problem,) = raised.value.problems
    assert problem.startswith("dataset noise, varying speed: ")
    assert problem.endswith("got a drive of 9 frames, expected at least 10")


@pytest.mark.parametrize(
    ("lines", "problem"),
    [
        ("nam = 1", "unknown key in the plan: got 'nam'"),
        ("name = 1", "name: got 1, expected a text"),
        ("datasets = []", "datasets: got nothing, expected at least one"),
        ('datasets = ["nois"]', "dataset nois: not in "),
        ('datasets = ["noise", "noise"]', "datasets: noise is there twice"),
        ('datasets = ["corridor"]', "dataset corridor: not in "),
        ('speeds = ["constnt"]', "unknown speed in speeds: got 'constnt', expected one of const"),
        ("speeds = [2]", "speeds: got 2, expected a text"),
        ("datasets = [1]", "datasets: got 1, expected a text or a table"),
        ('datasets = [{ name = "a" }]', "expected name, query and reference"),
        (
            'datasets = [{ name = "a", query = "x", reference = "y" }]',
            "dataset a: x does not exist",
        ),
        ('techniques = ["hogg"]', "unknown technique: got 'hogg'"),
        (
            'techniques = [{ name = "hog", parameters = { form = "chapter8" } }]',
            "hog parameter 'form': got 'chapter8'",
        ),
        ('techniques = [{ name = "hog", form = "chapter6" }]', "unknown key in a technique"),
        ('matchers = ["men"]', "unknown matcher: got 'men'"),
        ("sequence_lengths = [0]", "sequence_lengths: got 0, expected a whole number from 1"),
        ('sequence_lengths = ["3..1"]', "sequence_lengths: got '3..1'"),
        ("sequence_lengths = [true]", "sequence_lengths: got True"),
        ("sequence_lengths = [13]", "got 13, but dataset noise has only 12 frames"),
        (
            'sequence_lengths = ["dynamic"]\nmatchers = ["seqslam"]',
            "matcher seqslam: got the length 'dynamic'",
        ),
        ("seeds = [-1]", "seeds: got -1"),
        ("entropy = 1", "entropy: got 1, expected true or false"),
        ('modules = ["no_such_module"]', "no_such_module cannot be imported"),
        ('images = { resizer = "cv" }', "resizer: got 'cv', expected one of"),
        ("images = { resize = [-4] }", "resize: got -4, expected 1 to"),
        ("images = { encoders = [{ optimise = true }] }", "did you mean 'optimize'?"),
        ('images = { encoders = [{ optimize = "yes" }] }', "expected true or false"),
        ('images = { encoders = [{ library = "jpegli" }] }', "'library': got 'jpegli'"),
        ("images = { encoders = [{ library = true }] }", "library: got True, expected a text"),
        ("images = { encoders = [{ tables = true }] }", "got True, expected the path of a JSON"),
        ('images = { encoders = [{ tables = "no.json" }] }', "no.json: no such file"),
        ("images = { encoders = [{ tables = { luma = [1] } }] }", "unknown key in images.encoders"),
        (
            "images = { encoders = [{ tables = { luminance = [1, 2], chrominance = [1] } }] }",
            "images.encoders: tables: luminance table: got 2 steps, expected 64",
        ),
        ("compression = { levels = [100] }", "compression.levels: got 100, expected whole"),
        ('compression = { pairs = ["all"] }', "unknown compression.pairs: got 'all'"),
        ("compression = { levels = [0], query = [0] }", "got levels and query"),
        ('compression = { parts = ["gird"] }', "unknown compression.parts: got 'gird'"),
        ("video = { h264 = [30] }", "unknown key in video: got 'h264'"),
        ("video = { h265 = [52] }", "quality of h265: got 52, expected 0 to 51"),
        ("video = { h265 = [30], group = 5 }", "video.group: got 5, expected 1, 2, 4"),
        ("legibility = true", "legibility: got pictures that are not resized"),
        ('sent = ["int9"]', "unknown sent: got 'int9', expected one of pictures, exact"),
        ("sent = []", "sent: got nothing, expected at least one"),
        ('sent = [{ name = "sketch", parameters = { bits = 9 } }]', "bits: got 9, expected a mult"),
        ('sent = [{ name = "sketch", bits = 8 }]', "unknown key in sent: got 'bits'"),
        ("sent = [{ parameters = { bits = 8 } }]", "unknown sent: got ''"),
        (
            'sent = [{ name = "pictures", parameters = { bits = 8 } }]',
            "sent: got pictures with parameters, expected none",
        ),
        (
            'techniques = ["patchnorm"]\nsent = ["exact", "int8", "sketch"]',
            "technique patchnorm: got descriptors of uint8 to be sent as int8, sketch",
        ),
    ],
)
def test_what_can_be_wrong(data: Path, lines: str, problem: str) -> None:
    with pytest.raises(PlanError) as caught:
        plan_of(data, lines)
    assert any(problem in line for line in caught.value.problems), caught.value.problems
    assert len(caught.value.problems) <= 2
    assert not any("\n" in line for line in caught.value.problems)


def test_all_problems_at_once(data: Path) -> None:
    lines = 'nam = 1\ndatasets = ["nois"]\ntechniques = ["hogg"]\nseeds = [-1]'
    with pytest.raises(PlanError) as caught:
        plan_of(data, lines, source="plan.toml")
    assert len(caught.value.problems) == 4
    assert str(caught.value).splitlines()[0] == "plan plan.toml: 4 problems"


def test_missing_datasets_may_be_recorded(data: Path) -> None:
    plan = plan_of(data, 'datasets = ["noise", "sped"]', on_missing="record")
    assert plan.missing == ("sped",)


def test_files(data: Path, tmp_path: Path) -> None:
    with pytest.raises(DataMissingError, match="no such file"):
        load_plan(tmp_path / "none.toml")
    (tmp_path / "a plan.toml").write_text("= 1")
    with pytest.raises(PlanError, match="not TOML"):
        load_plan(tmp_path / "a plan.toml")
    text = 'data = "elsewhere"\ndatasets = ["noise"]\ntechniques = ["hog"]'
    (tmp_path / "a plan.toml").write_text(text)
    plan = load_plan(tmp_path / "a plan.toml", data=data)
    assert (plan.name, plan.text) == ("a plan", text)


def test_a_choice_without_a_size() -> None:
    choice = TechniqueChoice("hog", {"form": "chapter6"})
    assert choice.at(None) == choice


def test_tables_of_a_file_and_of_the_plan_itself(data: Path, tmp_path: Path) -> None:
    tuned = replace(STANDARD_TABLES, luminance=(7,) * 64, name="mine")
    save_tables(tmp_path / "tables.json", tuned)
    inline = f"{{ name = 'mine', luminance = {[7] * 64}, chrominance = {[*tuned.chrominance]} }}"
    plan = plan_of(
        data,
        f"""
        compression = {{ levels = [50] }}
        images = {{ encoders = [{{ optimize = true, tables = "tables.json" }},
                                {{ tables = {inline} }}] }}
        """,
        root=tmp_path,
    )
    encoders = [pair.query.encoder for pair in plan.pairs]
    assert encoders == [Encoder(optimize=True, tables=tuned), Encoder(tables=tuned)]
    assert encoders[0].label == f"pillow 4:2:0 optimize tables={tuned.label}"


def test_a_tables_file_is_found_beside_the_plan(data: Path, tmp_path: Path) -> None:
    save_tables(tmp_path / "own.json", STANDARD_TABLES)
    lines = (
        f'data = "{data}"',
        'datasets = ["noise"]',
        'techniques = ["hog"]',
        "compression = { levels = [90] }",
        'images = { encoders = [{ tables = "own.json" }] }',
    )
    (tmp_path / "plan.toml").write_text("\n".join(lines))
    (pair,) = load_plan(tmp_path / "plan.toml").pairs
    assert pair.query.encoder.tables == pair.reference.encoder.tables == STANDARD_TABLES


def test_opencv_takes_no_tables(data: Path, tmp_path: Path) -> None:
    save_tables(tmp_path / "own.json", STANDARD_TABLES)
    lines = 'images = { encoders = [{ library = "opencv", tables = "own.json" }] }'
    with pytest.raises(PlanError, match="opencv writes no tables"):
        plan_of(data, lines, root=tmp_path)
