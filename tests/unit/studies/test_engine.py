"""The engine: every run once, nothing twice, the same records whoever computes them."""

import json
import math
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from tests.unit.studies.tiny import hashes, tiny_plan, tiny_registered, write_dataset

import retraverse as rt
from retraverse.errors import InputError
from retraverse.images.bare_jpeg import TableSet, strip_tables
from retraverse.images.codecs import encode_group
from retraverse.images.worsen import frame_bytes, worsened
from retraverse.images.worsening import Worsening
from retraverse.matching.match_traverse import match_windows, query_windows
from retraverse.matching.pairwise import describe_query
from retraverse.metrics import evaluate
from retraverse.studies.engine import run_study
from retraverse.studies.estimate import estimate_study
from retraverse.studies.judging.selection import data_per_answer
from retraverse.studies.keeping.cache import StudyCache, load_matrix
from retraverse.studies.keeping.records import RunRecord
from retraverse.studies.keeping.study_folder import read_study
from retraverse.studies.plans.plan_file import PlanError
from retraverse.studies.tasks.work import plan_work
from retraverse.techniques.sending import coding, received


@pytest.fixture(autouse=True)
def _tiny() -> Iterator[None]:
    with tiny_registered():
        yield


@pytest.fixture
def data(tmp_path: Path) -> Path:
    write_dataset(tmp_path / "data" / "noise", n_frames=40)
    return tmp_path / "data"


def test_records_are_those_of_the_library_by_hand(data: Path, tmp_path: Path) -> None:
    hog = '[{ name = "hog", parameters = { resolution = 64 } }]'
    plan = tiny_plan(data, sequence_lengths="[1, 4]", techniques=hog, modules="[]")
    result = run_study(plan, tmp_path / "study", workers=0)
    assert (result.n_runs, result.n_ok, result.n_described) == (8, 8, 160)
    (dataset,) = plan.datasets
    for record in read_study(tmp_path / "study"):
        query, reference = (
            worsened(drive, Worsening(compression=c))
            for drive, c in (
                (dataset.query(), record.compression_query),
                (dataset.reference(), record.compression_reference),
            )
        )
        route = rt.build_map(reference, rt.technique("hog", resolution=64))
        scores = rt.similarity(query, route)
        kept = load_matrix(tmp_path / "study" / "cache", record.similarity_key)
        assert kept is not None
        assert np.abs(kept - scores).max() < 1e-6
        matches = rt.match(query, route, sequence_length=int(record.sequence_length))
        expected = evaluate(matches, dataset.truth())
        assert record.accuracy == expected.accuracy
        assert (record.accuracy_low, record.accuracy_high) == tuple(expected.accuracy_interval)
        assert record.auc == pytest.approx(expected.auc)
        assert record.answer_reference == tuple(matches.reference)
        assert record.answer_correct == tuple(expected.correct)
        sizes = frame_bytes(query)
        assert record.query_bytes_total == sizes.sum()
        assert record.query_bytes_mean == pytest.approx(sizes.mean())
        assert record.n_candidates == 40 - int(record.sequence_length) + 1
        assert record.encode_s > 0 < record.match_s < record.vpr_s
        provenance = json.loads(record.provenance)
        assert provenance["query"]["sha256"] == dataset.query().content_hash()
        assert provenance["reference"]["sha256"] == dataset.reference().content_hash()


def test_dynamic_lengths_and_first_regions_as_by_hand(data: Path, tmp_path: Path) -> None:
    plan = tiny_plan(
        data,
        techniques='[{ name = "convsequential", parameters = { resolution = 64 } }]',
        sequence_lengths='[3, "dynamic"]',
        compression='{ levels = ["none"] }',
        modules="[]",
    )
    run_study(plan, tmp_path / "study", workers=0)
    (dataset,) = plan.datasets
    route = rt.build_map(dataset.reference(), rt.technique("convsequential", resolution=64))
    by_length = {record.sequence_length: record for record in read_study(tmp_path / "study")}
    for text, length in (("3", 3), ("dynamic", "dynamic")):
        matches = rt.match(dataset.query(), route, sequence_length=length)  # type: ignore[arg-type]
        assert by_length[text].answer_reference == tuple(matches.reference)
        assert by_length[text].mean_sequence_length == matches.sequence_length.mean()
    assert by_length["dynamic"].sequence_lengths == tuple(matches.sequence_length)


def test_what_is_sent_as_by_hand(data: Path, tmp_path: Path) -> None:
    plan = tiny_plan(
        data,
        sequence_lengths="[1, 3]",
        sent='["pictures", "exact", { name = "projected", parameters = { dimensions = 2 } }]',
        compression='{ levels = ["none"] }',
    )
    assert run_study(plan, tmp_path / "study", workers=0).n_ok == plan.n_runs == 6
    (dataset,) = plan.datasets
    technique = rt.technique("tiny")
    route = rt.build_map(dataset.reference(), technique)
    seen = describe_query(dataset.query(), route)
    records = {(one.descriptor_coding, one.sequence_length): one for one in _records(tmp_path)}
    kinds = {"": None, "exact": None, "projected(dimensions=2)": coding("projected", dimensions=2)}
    for (label, length), record in records.items():
        chosen = kinds[label]
        arrived = seen
        if chosen is not None:
            arrived = received(seen, route.descriptions(), chosen).descriptions
        expected = rt.match(arrived, route, sequence_length=int(length))
        assert record.answer_reference == tuple(expected.reference)
        assert record.descriptor_bytes == 4 * 36
    pictures, exact, few = (records[label, "1"] for label in kinds)
    assert exact.accuracy == pictures.accuracy > few.accuracy  # Two numbers of 36 are too few.
    assert (pictures.coded_bytes, pictures.coding_shared_bytes) == (-1, -1)
    assert (exact.coded_bytes, exact.coding_shared_bytes) == (4 * 36, 0)
    assert (few.coded_bytes, few.coding_shared_bytes) == (2, 4 * (3 * 36 + 2))
    assert data_per_answer(records["projected(dimensions=2)", "3"]) == 6
    assert data_per_answer(pictures) == pictures.query_bytes_mean


def test_who_asks_for_codings_later_repeats_nothing(data: Path, tmp_path: Path) -> None:
    plain = tiny_plan(data)
    coded = tiny_plan(data, sent='["pictures", "int8"]')
    first = run_study(plain, tmp_path / "study", workers=0)
    second = run_study(coded, tmp_path / "study", workers=0)
    assert (second.n_kept, second.n_ok, second.n_described) == (first.n_ok, first.n_ok, 0)


def test_windows_are_as_long_as_who_drives_finds(data: Path, tmp_path: Path) -> None:
    """A sketch of few bits makes all frames unlike; the lengths are found before it is made."""
    coarse = '{ name = "sketch", parameters = { bits = 64 } }'
    plan = tiny_plan(
        data,
        techniques='[{ name = "convsequential", parameters = { resolution = 64 } }]',
        sent=f'["pictures", {coarse}]',
        sequence_lengths='["dynamic"]',
        compression='{ levels = ["none"] }',
        modules="[]",
    )
    run_study(plan, tmp_path / "study", workers=0)
    (dataset,) = plan.datasets
    route = rt.build_map(dataset.reference(), rt.technique("convsequential", resolution=64))
    seen = describe_query(dataset.query(), route)
    arrived = received(seen, route.descriptions(), coding("sketch", bits=64)).descriptions
    lengths = query_windows(seen, route, "dynamic")
    assert query_windows(arrived, route, "dynamic").tolist() != lengths.tolist()
    (expected,) = match_windows(arrived, route, [lengths])
    by_coding = {record.descriptor_coding: record for record in _records(tmp_path)}
    coded = by_coding["sketch(bits=64)"]
    assert coded.answer_reference == tuple(expected.reference)
    assert coded.answer_score == pytest.approx(expected.score, rel=1e-5)
    assert coded.sequence_lengths == by_coding[""].sequence_lengths == tuple(lengths)
    # The entropies of regions and picture go along as they are, beside length and bits.
    others = sum(spec.n_bytes for spec in route.technique.layout.arrays.values())
    others -= route.technique.layout.descriptor.n_bytes
    assert others > 0
    assert coded.coded_bytes == 4 + 64 // 8 + others
    assert coded.vpr_s > coded.encode_s * coded.mean_sequence_length + coded.match_s


def test_frames_without_a_descriptor_send_none(tmp_path: Path) -> None:
    folder = write_dataset(tmp_path / "data" / "noise", n_frames=40)
    for number in range(10):
        cv2.imwrite(str(folder / "query" / f"{number:03d}.png"), np.zeros((24, 32), np.uint8))
    plan = tiny_plan(
        tmp_path / "data",
        sent='["pictures", "int8", "projected"]',
        sequence_lengths="[1]",
        compression='{ levels = ["none"] }',
    )
    run_study(plan, tmp_path / "study", workers=0)
    for record in _records(tmp_path):
        assert record.no_descriptor_share == 0.25
        assert record.answer_reference[:10] == (-1,) * 10
        if record.descriptor_coding:
            assert data_per_answer(record) == pytest.approx(0.75 * record.coded_bytes)


def _records(folder: Path) -> tuple[RunRecord, ...]:
    return read_study(folder / "study")


def made_up_height(worsening: Worsening) -> float:
    """Return something that depends on what is done; the real one takes seconds."""
    return math.inf if worsening.video is not None else len(worsening.label) / 1000


def test_parts_video_and_legibility_as_by_hand(
    data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("av", reason="the extra 'video' is not installed")
    measured = "retraverse.studies.tasks.describe_task.smallest_legible_height"
    monkeypatch.setattr(measured, made_up_height)
    plan = tiny_plan(
        data,
        sequence_lengths="[3]",
        images='{ resize = [64], resizer = "opencv" }',
        compression='{ levels = ["none", 97], parts = ["whole", "grid"] }',
        video="{ h265 = [40], group = 16 }",
        legibility="true",
    )
    run_study(plan, tmp_path / "study", workers=0)
    (dataset,) = plan.datasets
    records = {
        (one.compression_query, one.jpeg_part, one.video): one
        for one in read_study(tmp_path / "study")
    }
    assert len(records) == len(plan.pairs) == 4
    for pair in plan.pairs:
        way = pair.query
        record = records[
            -1 if way.compression is None else way.compression,
            way.part,
            "" if way.video is None else way.video.codec,
        ]
        query, reference = (
            worsened(drive, worsening)
            for drive, worsening in (
                (dataset.query(), way),
                (dataset.reference(), pair.reference),
            )
        )
        route = rt.build_map(reference, rt.technique("tiny"))
        matches = rt.match(query, route, sequence_length=3)
        assert record.answer_reference == tuple(matches.reference)
        # What cannot be read at all is no number in a record.
        height = math.nan if way.video is not None else made_up_height(way)
        assert record.legible_height == pytest.approx(height, nan_ok=True)
    files = worsened(dataset.query(), Worsening(64, "opencv", 97))
    known = TableSet.for_encoder(compressions=[97])
    bare = [len(strip_tables(frame.encoded() or b"", known)) for frame in files]
    assert records[97, "", ""].query_bare_bytes_mean == pytest.approx(np.mean(bare))
    assert np.isnan(records[97, "grid", ""].query_bare_bytes_mean)
    pictures = [frame.grey() for frame in worsened(dataset.query(), Worsening(64, "opencv"))]
    groups = [encode_group(pictures[at : at + 16], "h265", 40) for at in range(0, 40, 16)]
    sent = records[-1, "", "h265"]
    assert sent.query_bytes_total == sum(map(len, groups))
    assert (sent.video_quality, sent.group_length) == (40, 16)


def test_each_speed_is_a_dataset_of_its_own(data: Path, tmp_path: Path) -> None:
    speeds = ("constant", "stops", "detour", "jump")
    plan = tiny_plan(
        data,
        speeds=str(list(speeds)),
        sequence_lengths="[3]",
        compression='{ levels = ["none"] }',
    )
    result = run_study(plan, tmp_path / "study", workers=0)
    assert result.n_ok == len(speeds)
    records = read_study(tmp_path / "study")
    for of_each in ("run_id", "similarity_key", "dataset", "truth"):
        assert len({getattr(record, of_each) for record in records}) == len(speeds)
    by_name = {record.dataset: record for record in records}
    for dataset in plan.datasets:
        record, query, reference = by_name[dataset.name], dataset.query(), dataset.reference()
        route = rt.build_map(reference, rt.technique("tiny"))
        scores = rt.similarity(query, route)
        kept = load_matrix(tmp_path / "study" / "cache", record.similarity_key)
        assert kept is not None
        # A row for every frame of the drive, also where one picture is there several times.
        assert np.abs(kept - scores).max() < 1e-6
        matches = rt.match(query, route, sequence_length=3)
        assert record.answer_reference == tuple(matches.reference)
        assert record.accuracy == evaluate(matches, dataset.truth()).accuracy
        assert (record.n_queries, record.n_references) == (len(query), len(reference))


def test_entropy_is_measured_where_asked(data: Path, tmp_path: Path) -> None:
    plan = tiny_plan(data, entropy="true", sequence_lengths="[1]")
    run_study(plan, tmp_path / "study", workers=0)
    for record in read_study(tmp_path / "study"):
        assert 0 < record.entropy_query_mean < 0.7925


def test_dynamic_lengths_of_a_technique_without_entropy(data: Path, tmp_path: Path) -> None:
    changes = {"sequence_lengths": '["dynamic"]', "compression": '{ levels = ["none"] }'}
    hog = '[{ name = "hog", parameters = { resolution = 64 } }]'
    plan = tiny_plan(data, techniques=hog, modules="[]", **changes)
    run_study(plan, tmp_path / "study", workers=0)
    (record,) = read_study(tmp_path / "study")
    (dataset,) = plan.datasets
    route = rt.build_map(dataset.reference(), rt.technique("hog", resolution=64))
    matches = rt.match(dataset.query(), route, sequence_length="dynamic")
    assert record.answer_reference == tuple(matches.reference)


def test_worker_processes_give_the_same_records(data: Path, tmp_path: Path) -> None:
    hog = '{ name = "hog", parameters = { resolution = 64 } }'
    changes = {"techniques": f'["tiny", {hog}]', "matchers": '["mean", "seqslam", "hmm"]'}
    plan = tiny_plan(data, **changes)
    for workers in (0, 2):
        result = run_study(plan, tmp_path / f"study {workers}", workers=workers)
        assert result.n_ok == 72
    here, there = (hashes(read_study(tmp_path / f"study {workers}")) for workers in (0, 2))
    assert here == there


def test_again_nothing_is_left_and_from_the_cache_nothing_is_described(
    data: Path, tmp_path: Path
) -> None:
    plan = tiny_plan(data)
    first = run_study(plan, tmp_path / "study", workers=0)
    before = read_study(tmp_path / "study")
    again = run_study(plan, tmp_path / "study", workers=0)
    assert (first.n_ok, first.n_kept, again.n_ok, again.n_kept) == (12, 0, 0, 12)
    other = run_study(plan, tmp_path / "other", workers=0, cache=tmp_path / "study" / "cache")
    assert (other.n_ok, other.n_described) == (12, 0)
    assert hashes(read_study(tmp_path / "other")) == hashes(before)
    # From ready matrices t_e is the one that was measured.
    assert {record.encode_s for record in before} == {
        record.encode_s for record in read_study(tmp_path / "other")
    }


def test_every_picture_is_described_once_for_all_pairs(data: Path, tmp_path: Path) -> None:
    plan = tiny_plan(data, compression='{ levels = [0, 50, 99], pairs = ["grid"] }')
    result = run_study(plan, tmp_path / "study", workers=0)
    assert result.n_runs == 27
    assert result.n_described == 2 * 3 * 40


def test_a_plan_edited_keeps_what_it_still_asks_for(data: Path, tmp_path: Path) -> None:
    study = tmp_path / "study"
    run_study(tiny_plan(data, sequence_lengths="[1, 2]"), study, workers=0)
    before = hashes(read_study(study))
    result = run_study(tiny_plan(data, sequence_lengths="[2, 5]"), study, workers=0)
    assert (result.n_kept, result.n_ok, result.n_described) == (4, 4, 0)
    after = hashes(read_study(study))
    assert {record.sequence_length for record in read_study(study)} == {"2", "5"}
    assert after.items() & before.items() == {
        (key, value) for key, value in before.items() if key in after
    }
    assert len(list((study / "superseded").iterdir())) > 0


def test_two_equal_techniques_and_datasets_of_one_content(data: Path, tmp_path: Path) -> None:
    write_dataset(data / "copy", n_frames=40)
    plan = tiny_plan(data, datasets='["noise", "copy"]', techniques='["tiny", "tiny"]')
    result = run_study(plan, tmp_path / "study", workers=0)
    assert result.n_runs == result.n_ok == 24
    assert result.n_described == 160, "equal pictures are described once"


def test_progress_counts_to_its_total(data: Path, tmp_path: Path) -> None:
    seen: dict[str, list[int]] = {}

    def watch(items: Iterable[Any], *, total: int, label: str) -> Iterable[Any]:
        seen[label] = [total, 0]
        for item in items:
            seen[label][1] += 1
            yield item

    run_study(tiny_plan(data), tmp_path / "study", workers=0, progress=watch)
    assert any(label.startswith("study tiny study") for label in seen)
    assert all(total == count > 0 for total, count in seen.values())


def test_what_is_not_here_is_on_record(data: Path, tmp_path: Path) -> None:
    plan = replace(tiny_plan(data), missing=("elsewhere",))
    result = run_study(plan, tmp_path / "study", workers=0)
    assert (result.n_missing, result.n_ok) == (1, 12)
    (missing,) = [r for r in read_study(tmp_path / "study") if r.status == "missing"]
    assert (missing.dataset, missing.error) == ("elsewhere", "dataset elsewhere: not here")


def test_seeds_move_intervals_only(data: Path, tmp_path: Path) -> None:
    changes = {"seeds": "[1, 2]", "sequence_lengths": "[1]", "compression": "{ levels = [99] }"}
    plan = tiny_plan(data, techniques='[{ name = "tiny", parameters = { side = 2 } }]', **changes)
    run_study(plan, tmp_path / "study", workers=0)
    one, two = read_study(tmp_path / "study")
    assert one.answer_reference == two.answer_reference
    assert 0 < one.accuracy < 1, "else the intervals have nothing to differ in"


def test_one_study_at_a_time_in_a_folder(data: Path, tmp_path: Path) -> None:
    from retraverse.studies.keeping.study_folder import StudyFolder

    with (
        StudyFolder.opened(tmp_path / "study"),
        pytest.raises(InputError, match="another process is running it"),
    ):
        run_study(tiny_plan(data), tmp_path / "study", workers=0)


def test_wrong_calls(data: Path, tmp_path: Path) -> None:
    plan = tiny_plan(data)
    with pytest.raises(InputError, match="workers: got -1"):
        run_study(plan, tmp_path / "study", workers=-1)
    with pytest.raises(PlanError, match="has only 40 frames"):
        run_study(replace(plan, sequence_lengths=(41,)), tmp_path / "study")
    with pytest.raises(InputError, match="expected tcp://HOST:PORT"):
        run_study(plan, tmp_path / "study", cluster="http://x")


def test_estimate_counts_what_is_left(data: Path, tmp_path: Path) -> None:
    plan = tiny_plan(data)
    before = estimate_study(plan, tmp_path / "study")
    assert (before.n_runs, before.n_pictures, before.problems) == (12, 160, ())
    assert before.seconds > 0
    assert not (tmp_path / "study").exists(), "an estimate writes nothing"
    run_study(plan, tmp_path / "study", workers=0)
    size = sum(path.stat().st_size for path in (tmp_path / "study").rglob("*") if path.is_file())
    assert before.n_bytes / 3 < size < 3 * before.n_bytes
    assert estimate_study(plan, tmp_path / "study").n_pictures == 0


def test_estimate_tells_what_fails(data: Path, tmp_path: Path) -> None:
    write_dataset(data / "bad", n_frames=4, marked=0)
    plan = tiny_plan(
        data,
        datasets='["bad"]',
        techniques='[{ name = "tiny", parameters = { trouble = "raise" } }]',
        compression='{ levels = ["none"] }',
    )
    (problem,) = estimate_study(plan, tmp_path / "study").problems
    assert problem == "tiny on 000.png: ValueError: a picture it cannot stand"


def test_memory_of_planning_does_not_hold_pictures(data: Path, tmp_path: Path) -> None:
    work = plan_work(tiny_plan(data), StudyCache(tmp_path / "cache"))
    assert all(frame.path is not None for task in work.tasks for frame in task.frames)
    assert [len(task.frames) for task in work.tasks] == [32, 8, 32, 8]


def test_lengths_that_share_a_pass_cost_what_each_costs_alone(data: Path, tmp_path: Path) -> None:
    plan = tiny_plan(
        data,
        techniques='[{ name = "convsequential", parameters = { resolution = 128 } }]',
        sequence_lengths='[1, 3, 12, "dynamic"]',
        compression='{ levels = ["none"] }',
        modules="[]",
    )
    result = run_study(plan, tmp_path / "study", workers=0)
    for record in read_study(tmp_path / "study"):
        entry = StudyCache(tmp_path / "study" / "cache").load(record.similarity_key)
        assert entry is not None
        # K rows of similarity, and what adding them up took: no more than the whole study.
        rows_s = record.mean_sequence_length * float(entry["row_s"])
        assert rows_s < record.match_s < rows_s + result.seconds / record.n_windows
