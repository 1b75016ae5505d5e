"""Certificates somebody has edited: with the digest as it was, and with one made anew to fit."""

from __future__ import annotations

import io
import math
import zipfile

import certificate_case as case
import numpy as np
import pytest

from verify import evidence
from verify.evidence import EvidenceError
from verify.judge.certificate import CERTIFICATE, check_certificate, read_certificate

STALE = "the digest is not that of the numbers"

# A hall of 40 x 4 m with a rack on mesh lines, so that there are dropped triangles of both kinds.
RACK = [[18.0, 0.0], [22.0, 0.0], [22.0, 1.0], [18.0, 1.0]]


def asked_about(rack=RACK, **changes):
    return case.question(world={"obstacles": [{"name": "rack", "vertices": rack}]}, **changes)


@pytest.fixture(scope="module")
def asked():
    return asked_about()


@pytest.fixture
def arrays(asked):
    mesh = case.grid(np.linspace(0.0, 40.0, 41), np.linspace(0.0, 4.0, 9))
    return case.make(asked, *mesh, lambda p: p[:, 0])


@pytest.fixture(params=[False, True], ids=["float", "exact"])
def exact(request):
    return request.param


def both(arrays, asked, folder, exact):
    """Reasons with the digest as it is, and with one that fits the numbers."""
    told = []
    for version in (arrays, case.sealed(arrays)):
        proof = case.proof(version, asked, folder, exact=exact)
        assert proof.holds == (not proof.reasons)
        assert proof.holds or proof.travel_time == 0.0
        told.append(" | ".join(proof.reasons))
    return told


def refused(arrays, asked, folder, exact, words):
    """Both versions are refused: the one by its digest too, the other by the mathematics alone."""
    stale, fitting = both(arrays, asked, folder, exact)
    assert STALE in stale
    assert STALE not in fitting
    assert words in stale
    assert words in fitting


def test_the_certificate_as_made_holds(arrays, asked, tmp_path, exact):
    assert both(arrays, asked, tmp_path, exact) == ["", ""]


# --- the function -----------------------------------------------------------------------------------


def test_u_scaled_up_by_a_millionth(arrays, asked, tmp_path, exact):
    arrays["u_vertex"] = arrays["u_vertex"] * (1.0 + 1e-6)
    arrays["u_edge"] = arrays["u_edge"] * (1.0 + 1e-6)
    refused(arrays, asked, tmp_path, exact, "u is steeper than the lower bound of 1/V at")


@pytest.mark.parametrize("key", ["u_vertex", "u_edge"])
def test_one_coefficient_nudged(key, arrays, asked, tmp_path, exact):
    # At the tightest corner i, c_ij adds to the gradient along grad lambda_j, and for one j not across it.
    slope, least = case.corner_values(arrays)
    row, corner = np.unravel_index(np.argmax(slope / least), slope.shape)
    triangle = arrays["triangles"][row]
    numbers = [triangle[corner]]
    if key == "u_edge":
        ends = [sorted((triangle[corner], triangle[(corner + i) % 3])) for i in (1, 2)]
        numbers = [np.flatnonzero((arrays["edges"] == pair).all(axis=1))[0] for pair in ends]
    raised = 0
    for number in numbers:
        for nudge in (1e-6, -1e-6):
            changed = {**arrays, key: arrays[key].copy()}
            changed[key][number] += nudge
            steep, limit = case.corner_values(changed)
            if (steep > limit * (1.0 + 1e-9)).any():
                raised += 1
                refused(changed, asked, tmp_path, exact, "u is steeper than the lower bound of 1/V at")
    assert raised


def test_a_harmless_nudge_is_refused_by_the_digest_alone(arrays, asked, tmp_path, exact):
    slope, least = case.corner_values(arrays)
    vertices, room = arrays["triangles"], 1.0 - slope / least
    slackest = np.full(len(arrays["vertices"]), np.inf)
    np.minimum.at(slackest, vertices.ravel(), np.repeat(room.min(axis=1), 3))
    spare = int(np.argmax(np.where(np.isfinite(slackest), slackest, -1.0)))
    assert slackest[spare] > 0.01
    ends = np.concatenate([vertices[arrays["start_triangle"]], vertices[arrays["goal_triangle"]]])
    assert spare not in ends
    arrays["u_vertex"] = arrays["u_vertex"].copy()
    arrays["u_vertex"][spare] += 1e-9
    stale, fitting = both(arrays, asked, tmp_path, exact)
    assert stale.startswith(STALE)
    assert "|" not in stale
    assert fitting == ""


def test_more_claimed_than_proven(arrays, asked, tmp_path, exact):
    arrays["travel_time"] = arrays["travel_time"] + 1e-6
    refused(arrays, asked, tmp_path, exact, "but u(goal) - u(start) is only")


# --- the minorants ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("key", "change", "words"),
    [
        ("weight", lambda w: w * (1.0 + 1e-6), "the weights sum to more than 1 in"),
        ("weight", lambda w: w - 1e-9, "a weight is negative in"),
        ("speed", lambda s: -s, "the speed of a tangent is not between"),
        ("speed", lambda s: s * 3.0, "u is steeper than the lower bound of 1/V at"),
        ("feature", lambda f: np.full_like(f, 3), "u is steeper than the lower bound of 1/V at"),
    ],
    ids=["heavy", "negative", "backwards", "fast", "other feature"],
)
def test_terms_changed(key, change, words, arrays, asked, tmp_path, exact):
    arrays[key] = change(arrays[key])
    refused(arrays, asked, tmp_path, exact, words)


# --- the mesh ---------------------------------------------------------------------------------------

PER_TRIANGLE = ("triangles", "side", "feature", "speed", "weight")


def without(arrays, row):
    changed = {**arrays, **{key: np.delete(arrays[key], row, axis=0) for key in PER_TRIANGLE}}
    for end in ("start_triangle", "goal_triangle"):
        changed[end] = arrays[end] - (row < arrays[end])
    return changed


def middle(arrays):
    """A kept triangle away from start, goal and rim, and how a message names one of its sides."""
    corners = (arrays["vertices"] * arrays["unit"])[arrays["triangles"]]
    row = int(np.argmin(np.hypot(*(corners.mean(axis=1) - [12.3, 2.2]).T)))
    (x0, y0), (x1, y1) = corners[row, 0], corners[row, 1]
    return row, f"({x0:g}, {y0:g}) to ({x1:g}, {y1:g}) m", f"({x1:g}, {y1:g}) to ({x0:g}, {y0:g}) m"


def test_a_triangle_removed(arrays, asked, tmp_path, exact):
    row, _, back = middle(arrays)
    refused(without(arrays, row), asked, tmp_path, exact, "no other triangle has, as a whole side, the side")
    refused(without(arrays, row), asked, tmp_path, exact, back)  # the neighbour's side is left alone
    refused(without(arrays, row), asked, tmp_path, exact, "m^2 less than the box")


def test_a_triangle_duplicated(arrays, asked, tmp_path, exact):
    row, side, _ = middle(arrays)
    changed = {**arrays, **{k: np.concatenate([arrays[k], arrays[k][row : row + 1]]) for k in PER_TRIANGLE}}
    refused(changed, asked, tmp_path, exact, "two triangles lie on the same side of the side from")
    refused(changed, asked, tmp_path, exact, side)
    refused(changed, asked, tmp_path, exact, "m^2 more than the box")


def test_a_triangle_turned_round(arrays, asked, tmp_path, exact):
    row, _, _ = middle(arrays)
    arrays["triangles"] = arrays["triangles"].copy()
    arrays["triangles"][row] = arrays["triangles"][row, ::-1]
    refused(arrays, asked, tmp_path, exact, "not anticlockwise with positive area: the triangle around (12.")


def test_a_triangle_flattened(arrays, asked, tmp_path, exact):
    row, _, _ = middle(arrays)
    arrays["triangles"] = arrays["triangles"].copy()
    arrays["triangles"][row, 2] = arrays["triangles"][row, 1]
    refused(arrays, asked, tmp_path, exact, "not anticlockwise with positive area")


def test_a_vertex_moved_across_its_neighbours(arrays, asked, tmp_path, exact):
    row, _, _ = middle(arrays)
    arrays["vertices"] = arrays["vertices"].copy()
    arrays["vertices"][arrays["triangles"][row, 0]] += [4096, 0]
    refused(arrays, asked, tmp_path, exact, "not anticlockwise with positive area")


def test_a_dropped_triangle_removed(arrays, asked, tmp_path, exact):
    for kind in (arrays["blocked_by"] == -2, arrays["blocked_by"] >= 0):
        row = int(np.flatnonzero(kind)[0])
        changed = {
            **arrays,
            **{key: np.delete(arrays[key], row, axis=0) for key in ("dropped", "blocked_by")},
        }
        refused(changed, asked, tmp_path, exact, "m^2 less than the box")


def test_a_dropped_triangle_blocked_by_something_else(arrays, asked, tmp_path, exact):
    row = int(np.flatnonzero(arrays["blocked_by"] == 0)[0])
    for reason, words in (
        (2, "a corner is farther from its feature than the robot must stay"),  # the wall opposite
        (-1, "dropped as outside the boundary, but inside it"),
        (-2, "dropped as inside an obstacle, but outside of it"),
        (-3, "blocked_by names neither a feature nor a polygon obstacle"),
    ):
        arrays["blocked_by"] = arrays["blocked_by"].copy()
        arrays["blocked_by"][row] = reason
        refused(arrays, asked, tmp_path, exact, words)


def test_the_triangles_most_in_the_way_dropped_too(arrays, asked, tmp_path, exact):
    # Without the tightest triangles u could be scaled further.
    slope, least = case.corner_values(arrays)
    row = int(np.argmax((slope / least).max(axis=1)))
    changed = without(arrays, row)
    changed["dropped"] = np.concatenate([arrays["dropped"], arrays["triangles"][row : row + 1]])
    changed["blocked_by"] = np.append(arrays["blocked_by"], np.int32(0))
    refused(changed, asked, tmp_path, exact, "a corner is farther from its feature than the robot must stay")


@pytest.mark.parametrize("end", ["start", "goal"])
def test_another_triangle_named_for_an_end(end, arrays, asked, tmp_path, exact):
    arrays[f"{end}_triangle"] = np.array(middle(arrays)[0])
    refused(arrays, asked, tmp_path, exact, f"the {end} (")


# --- the question -----------------------------------------------------------------------------------


def against(arrays, other, folder, exact):
    """Reasons when the scenario is another one: as made, and with the scenario's numbers copied over."""
    proof = case.proof(arrays, other, folder, exact=exact)
    limits = other.setting.limits
    law = [limits.radius, limits.braking, limits.reaction_time, limits.margin, limits.speed]
    fitted = {
        **arrays,
        "features": other.features.table,
        "start": np.array(other.setting.start.position),
        "goal": np.array(other.setting.goal.position),
        "law": np.array(law),
    }
    assert not proof.holds
    stale, fitting = both(fitted, other, folder, exact)
    assert STALE in stale
    return " | ".join(proof.reasons), fitting


def test_an_obstacle_moved_by_a_millimetre(arrays, tmp_path, exact):
    # Down by 1 mm: more room above the rack, where u is tight, and the mesh no longer fits it.
    moved = [[x, y - 0.001 if y else y] for x, y in RACK]
    told, fitting = against(arrays, asked_about(moved), tmp_path, exact)
    for vertex in (2, 3):
        key = f"world.obstacles[0].vertices[{vertex}][1] (rack)"
        assert f"made for {key} = 1.0; the scenario has 0.999" in told
    assert "u is steeper than the lower bound of 1/V" in fitting
    assert "a side of what it is said to lie in or outside of runs through it" in fitting


def test_an_obstacle_added_or_taken_away(arrays, tmp_path, exact):
    more = case.question(world={"obstacles": [{"vertices": RACK}, {"vertices": [[30, 1]]}]})
    told, _ = against(arrays, more, tmp_path, exact)
    assert "made for 8 sides, walls, points and circles; the scenario has 9" in told
    less = case.proof(arrays, case.question(), tmp_path, exact=exact)
    assert not less.holds
    assert "made for 8 sides, walls, points and circles; the scenario has 4" in " | ".join(less.reasons)


def test_the_boundary_moved(arrays, asked, tmp_path, exact):
    boundary = [[0, 0], [40, 0], [40, 4.001], [0, 4]]
    other = case.question(world={"boundary": boundary, "obstacles": [{"name": "rack", "vertices": RACK}]})
    told, fitting = against(arrays, other, tmp_path, exact)
    assert "made for world.boundary[2][1] = 4.0; the scenario has 4.001" in told
    assert "the box does not contain world.boundary[2] = (40, 4.001) m" in fitting


@pytest.mark.parametrize("end", ["start", "goal"])
def test_an_end_moved(end, arrays, tmp_path, exact):
    # Towards each other by 1 mm, u rises by less than before.
    x = {"start": 5.001, "goal": 34.999}[end]
    told, fitting = against(arrays, asked_about(**{end: {"position": [x, 2.0]}}), tmp_path, exact)
    assert f"made for {end}.position[0] = {5.0 if end == 'start' else 35.0}; the scenario has {x}" in told
    assert "but u(goal) - u(start) is only" in fitting


@pytest.mark.parametrize(
    ("section", "change", "key", "fitting_words"),
    [
        ("robot", {"radius": 0.49}, "robot.radius = 0.5; the scenario has 0.49", "u is steeper"),
        ("robot", {"radius": 0.49}, "robot.radius = 0.5; the scenario has 0.49", "farther from its feature"),
        ("robot", {"max_braking": 1.001}, "robot.max_braking = 1.0; the scenario has 1.001", "u is steeper"),
    ],
)
def test_another_robot(section, change, key, fitting_words, arrays, tmp_path, exact):
    told, fitting = against(arrays, asked_about(**{section: change}), tmp_path, exact)
    assert f"made for {key}" in told
    assert fitting_words in fitting


@pytest.mark.parametrize(
    ("section", "change", "key"),
    [
        ("robot", {"radius": 0.51}, "robot.radius = 0.5; the scenario has 0.51"),
        ("robot", {"max_speed": 1.0}, "robot.max_speed = inf; the scenario has 1.0"),
        ("braking", {"reaction_time": 0.1}, "braking.reaction_time = 0.0; the scenario has 0.1"),
        ("braking", {"margin": 0.01}, "braking.margin = 0.0; the scenario has 0.01"),
    ],
)
def test_a_slower_robot_has_its_own_question(section, change, key, arrays, tmp_path, exact):
    # The bound would hold for it too, but is not what was asked.
    told = case.proof(arrays, asked_about(**{section: change}), tmp_path, exact=exact)
    assert not told.holds
    assert f"made for {key}" in " | ".join(told.reasons)


# --- the file ---------------------------------------------------------------------------------------


def faults(data, folder):
    """The reasons for which a file is not read."""
    (folder / CERTIFICATE).write_bytes(data)
    with pytest.raises(EvidenceError) as error:
        read_certificate(folder)
    assert all(reason.startswith(f"{CERTIFICATE}: ") for reason in error.value.reasons)
    return " | ".join(error.value.reasons)


def test_no_file_is_no_certificate(tmp_path):
    assert read_certificate(tmp_path) is None


@pytest.mark.parametrize("share", [0.0, 0.01, 0.3, 0.7, 0.999])
def test_the_file_truncated(share, arrays, tmp_path):
    data = case.packed(arrays)
    assert "truncated or not an archive" in faults(data[: int(share * len(data))], tmp_path)


def test_a_byte_flipped_anywhere_is_seen_or_does_not_matter(arrays, asked, tmp_path):
    data = case.packed(arrays)
    true = case.proof(arrays, asked, tmp_path)
    seen = 0
    for place in np.linspace(0, len(data) - 1, 60).astype(int):
        changed = bytearray(data)
        changed[place] ^= 0x10
        (tmp_path / CERTIFICATE).write_bytes(changed)
        try:
            file = read_certificate(tmp_path)
        except EvidenceError:
            seen += 1
            continue
        proof = check_certificate(file, asked)  # dates and the like in the archive's own entries
        assert proof.travel_time in (0.0, true.travel_time)
    assert seen > 30


def test_arrays_missing_and_too_many(arrays, tmp_path):
    less = {key: value for key, value in arrays.items() if key != "weight"}
    assert "the array weight is missing" in faults(case.packed(less), tmp_path)
    more = {**arrays, "comment": np.zeros(1)}
    assert "holds what it should not: 'comment.npy'" in faults(case.packed(more), tmp_path)
    stream = io.BytesIO(case.packed(arrays))
    with zipfile.ZipFile(stream, "a") as archive, pytest.warns(UserWarning, match="Duplicate"):
        archive.writestr("weight.npy", b"")
    assert "two entries have the same name" in faults(stream.getvalue(), tmp_path)


@pytest.mark.parametrize(
    ("key", "change", "words"),
    [
        ("u_edge", lambda a: a.astype(np.float32), "its type is '<f4', expected '<f8'"),
        ("u_edge", lambda a: a.astype(">f8"), "its type is '>f8', expected '<f8'"),
        ("u_edge", lambda a: a.astype(complex), "its type is '<c16', expected '<f8'"),
        ("triangles", lambda a: a.astype(np.int64), "its type is '<i8', expected '<i4'"),
        ("triangles", lambda a: a[:, :2].copy(), "its shape is"),
        ("triangles", lambda a: a.ravel(), "its shape is"),
        ("triangles", lambda a: a[:0], "its shape is"),
        ("weight", lambda a: a[1:], "its shape is"),
        ("weight", lambda a: np.hstack([a, a]), "its shape is"),
        ("u_vertex", lambda a: a[:-1], "its shape is"),
        ("unit", lambda a: a[None], "its shape is"),
        ("format", lambda a: a + 1, "format = 2: must be 1"),
        ("u_edge", lambda a: np.append(a[:-1], np.nan), "= nan: must be finite"),
        ("u_vertex", lambda a: np.append(a[:-1], 1e10), "must be at most 1e+09 s"),
        ("speed", lambda a: a + np.inf, "speed[0][0] = inf: must be finite"),
        ("weight", lambda a: a * np.nan, "weight[0][0] = nan: must be finite"),
        ("law", lambda a: a * np.nan, "law[0] = nan: must be finite"),
        ("travel_time", lambda a: a + np.inf, "travel_time = inf: must be finite"),
        ("feature", lambda a: a + 8, "must be an index from -1 to 7"),
        ("feature", lambda a: a - 9, "must be an index from -1 to 7"),
        ("triangles", lambda a: a + 10**6, "must be an index from 0 to"),
        ("dropped", lambda a: a - 10**6, "must be an index from 0 to"),
        ("edges", lambda a: a - 10**6, "must be an index from 0 to"),
        ("start_triangle", lambda a: a - 10**6, "must be an index from 0 to"),
        ("goal_triangle", lambda a: a + 10**6, "must be an index from 0 to"),
        ("vertices", lambda a: a * 2**40, "is too large for a lattice coordinate"),
        ("vertices", lambda a: np.full_like(a, -(2**63)), "is too large for a lattice coordinate"),
        ("box", lambda a: a * 2**40, "is too large for a lattice coordinate"),
        ("box", lambda a: a[[2, 3, 0, 1]], "must have a width and a height"),
        ("unit", lambda a: a * 3.0, "must be a power of two"),
        ("unit", lambda a: -a, "must be a power of two"),
        ("unit", lambda a: a * 0.0, "must be a power of two"),
        ("unit", lambda a: a * 2.0**-90, "must be a power of two"),
        ("unit", lambda a: a * 2.0**90, "must be a power of two"),
        ("origin", lambda a: a + 0.1, "must be an integer multiple of the unit"),
        ("origin", lambda a: a + 2.0**50, "must be an integer multiple of the unit, and at most"),
    ],
)  # fmt: skip
def test_arrays_of_another_form_are_not_read(key, change, words, arrays, tmp_path):
    told = faults(case.packed(case.sealed({**arrays, key: change(arrays[key])})), tmp_path)
    assert key in told or "shape" in words
    assert words in told


def test_too_many_terms_and_no_triangles_are_not_read(arrays, tmp_path):
    many = {key: np.repeat(arrays[key], 9, axis=1) for key in ("feature", "speed", "weight")}
    assert "more than 16 terms a triangle" in faults(case.packed({**arrays, **many}), tmp_path)
    none = {key: arrays[key][:0] for key in PER_TRIANGLE}
    assert "triangles: none" in faults(case.packed({**arrays, **none}), tmp_path)


def test_objects_are_never_unpickled(arrays, tmp_path):
    trap = np.array([lambda: None], dtype=object)
    stream = io.BytesIO(case.packed({key: value for key, value in arrays.items() if key != "law"}))
    with zipfile.ZipFile(stream, "a") as archive:
        header = io.BytesIO()
        np.lib.format.write_array_header_1_0(header, np.lib.format.header_data_from_array_1_0(trap))
        archive.writestr("law.npy", header.getvalue() + b"cos\nsystem\n(S'false'\ntR.")
    assert "law: its type is '|O', expected '<f8'" in faults(stream.getvalue(), tmp_path)


def repacked(arrays, key, data):
    """The archive with other bytes for one array."""
    stream = io.BytesIO(case.packed({name: value for name, value in arrays.items() if name != key}))
    with zipfile.ZipFile(stream, "a", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr(f"{key}.npy", data)
    return stream.getvalue()


def header(text):
    body = text.encode() + b" " * (-(10 + len(text) + 1) % 64) + b"\n"
    return b"\x93NUMPY\x01\x00" + len(body).to_bytes(2, "little") + body


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("{'descr': '<f8', 'fortran_order': False, 'shape': (1000000000000,), }", "are declared"),
        ("{'descr': '<f8', 'fortran_order': False, 'shape': (10, 1000000000000000000000), }", "are declared"),
        ("{'descr': '<f8', 'fortran_order': False, 'shape': (0, 10**40), }", "u_edge"),
        ("{'descr': '<f8', 'fortran_order': False, 'shape': (-1, -8), }", "u_edge"),
        ("{'descr': '<f8', 'fortran_order': False, }", "u_edge"),
        ("{'descr': '<f8', 'fortran_order': 'no', 'shape': (8,), }", "u_edge"),
        ("{'descr': '|V0', 'fortran_order': False, 'shape': (8,), }", "its type is"),
        ("__import__('os').abort()", "u_edge"),
        ("[" * 900, "u_edge"),
        ("'", "u_edge"),
        ("{", "u_edge"),
        ("", "u_edge"),
    ],
)
def test_headers_that_lie_are_not_believed(text, words, arrays, tmp_path):
    data = repacked(arrays, "u_edge", header(text) + b"\0" * 64)
    assert words in faults(data, tmp_path)


def test_archives_that_unpack_to_more_than_is_allowed_are_not_unpacked(arrays, tmp_path, monkeypatch):
    # The same bomb scaled down: the limit is lowered, a thousandfold compressed array is put in.
    monkeypatch.setattr(evidence, "MAX_BYTES", 2**20)
    data = repacked(arrays, "u_edge", bytes(2**21))
    assert len(data) < 2**20
    assert f"unpacks to more than {2**20} bytes" in faults(data, tmp_path)


def test_an_entry_that_unpacks_to_more_than_it_declares_is_not_read(arrays, tmp_path):
    data = bytearray(repacked(arrays, "u_edge", case_bytes(arrays["u_edge"]) + bytes(2**20)))
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        true = archive.getinfo("u_edge.npy").file_size.to_bytes(4, "little")
    declared = len(case_bytes(arrays["u_edge"])).to_bytes(4, "little")
    directory = data.rindex(true)  # the entry of the central directory
    data[directory : directory + 4] = declared
    assert "truncated or not an archive" in faults(bytes(data), tmp_path)


def case_bytes(array):
    stream = io.BytesIO()
    np.save(stream, array)
    return stream.getvalue()


def test_other_packings_are_not_unpacked(arrays, tmp_path):
    stream = io.BytesIO(case.packed({key: value for key, value in arrays.items() if key != "unit"}))
    with zipfile.ZipFile(stream, "a", zipfile.ZIP_LZMA) as archive:
        archive.writestr("unit.npy", case_bytes(arrays["unit"]))
    assert "is packed in a way that numpy does not use" in faults(stream.getvalue(), tmp_path)


def test_the_order_in_memory_does_not_matter(arrays, asked, tmp_path):
    columns = {key: np.asfortranarray(arrays[key]) for key in ("vertices", "triangles", "speed")}
    assert columns["triangles"].flags.f_contiguous
    proof = case.proof({**arrays, **columns}, asked, tmp_path)
    assert proof.holds, proof.reasons
    assert proof.travel_time == case.proof(arrays, asked, tmp_path).travel_time


def test_a_link_out_of_the_folder_is_not_followed(arrays, tmp_path):
    outside, folder = tmp_path / "elsewhere.npz", tmp_path / "folder"
    outside.write_bytes(case.packed(arrays))
    folder.mkdir()
    (folder / CERTIFICATE).symlink_to(outside)
    with pytest.raises(EvidenceError, match="missing"):
        read_certificate(folder)


def test_a_certificate_for_a_better_robot_is_not_taken_for_this_one(tmp_path, exact):
    # Twice the braking: V is sqrt(2) times as great. The bound holds here too, but answers another question.
    quick = case.question(robot={"max_braking": 2.0})
    arrays = case.make(quick, *case.grid(np.linspace(0, 40, 41), np.linspace(0, 4, 9)), lambda p: p[:, 0])
    assert case.proof(arrays, quick, tmp_path, exact=exact).holds
    refusal = case.proof(arrays, case.question(), tmp_path, exact=exact)
    assert refusal.reasons == ("made for robot.max_braking = 2.0; the scenario has 1.0",)
    assert math.isfinite(refusal.worst)
