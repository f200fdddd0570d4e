"""Files that were made to do harm: links, pipes, bombs, names that are paths."""

from __future__ import annotations

import contextlib
import dataclasses
import io
import json
import os
import random
import stat
import struct
import subprocess
import sys
import threading
import zipfile
import zlib
from pathlib import Path

import cv2
import numpy as np
import pytest
import safetensors.numpy

from layoutexplore.agents import make_agent
from layoutexplore.agents.rl.card import find_policy, read_card, read_spec
from layoutexplore.agents.rl.hyperparameters import NetworkConfig
from layoutexplore.errors import (
    ConfigError,
    LayoutExploreError,
    MapError,
    ResultsError,
    WriteError,
    unknown_name,
)
from layoutexplore.files import (
    atomic,
    read_arrays,
    read_toml,
    read_yaml,
    to_toml,
    write_arrays,
    write_atomically,
)
from layoutexplore.files.archives import CHECKSUM
from layoutexplore.files.images import declared_size
from layoutexplore.files.limits import VARIABLE, limits
from layoutexplore.files.markup import read_xml
from layoutexplore.grids.grid import UNKNOWN
from layoutexplore.grids.image_map import grid_from_image
from layoutexplore.maps.geojson import save_plan
from layoutexplore.maps.library import load_plan
from layoutexplore.maps.sizes import check_outlines
from layoutexplore.models.forest_files import load_forests
from layoutexplore.simulation.config import SimulationConfig
from layoutexplore.simulation.simulation import Simulation
from layoutexplore.training.snapshots import explore_plan
from tests.files.mutators import BOMBS
from tests.maps.cases import two_rooms

ENDINGS = (".geojson", ".json", ".xml", ".yaml", ".png", ".pgm")


def png(width: int, height: int) -> bytes:
    """A PNG that declares a size."""
    header = b"IHDR" + struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)
    rows = zlib.compress(b"\0" * 1000)
    parts = [header, b"IDAT" + rows, b"IEND"]
    chunks = [struct.pack(">I", len(p) - 4) + p + struct.pack(">I", zlib.crc32(p)) for p in parts]
    return b"\x89PNG\r\n\x1a\n" + b"".join(chunks)


@pytest.mark.skipif(sys.platform == "win32", reason="needs pipes and devices")
@pytest.mark.parametrize("ending", ENDINGS)
def test_only_regular_files_are_read(tmp_path: Path, ending: str) -> None:
    os.mkfifo(tmp_path / f"pipe{ending}")
    (tmp_path / f"zero{ending}").symlink_to("/dev/zero")
    (tmp_path / f"folder{ending}").mkdir()
    for name in ("pipe", "zero", "folder"):
        with pytest.raises(MapError, match=rf"{name}{ending}: is a (pipe|device|folder)"):
            load_plan(tmp_path / f"{name}{ending}")


@pytest.mark.parametrize("kind", BOMBS)
def test_bombs_are_refused(tmp_path: Path, kind: str) -> None:
    readers = {"json": load_plan, "toml": read_toml, "yaml": read_yaml, "xml": read_xml}
    for bomb in BOMBS[kind]:
        path = tmp_path / f"bomb.{kind}"
        path.write_bytes(bomb)
        try:
            readers[kind](path)
        except LayoutExploreError as error:
            assert str(path) in str(error) and len(str(error)) < 1000
        else:
            assert kind in ("yaml", "xml") and len(bomb) < 2000  # harmless ones


@pytest.mark.parametrize("side", [8000, 20_000, 2**31 - 1])
def test_the_declared_size_of_an_image_comes_first(tmp_path: Path, side: int) -> None:
    (tmp_path / "bomb.png").write_bytes(png(side, side))
    with pytest.raises(MapError, match=rf"{side} x {side} pixels, and the limit image_pixels"):
        load_plan(tmp_path / "bomb.png")


@pytest.mark.parametrize("ending", [".png", ".jpg", ".bmp", ".tif", ".pgm", ".ppm"])
def test_every_header_declares_what_is_decoded(ending: str) -> None:
    rng = np.random.default_rng(1)
    for rows, cols in ((1, 7), (30, 3), (64, 65)):
        shape = (rows, cols) if ending == ".pgm" else (rows, cols, 3)
        data = cv2.imencode(ending, rng.integers(0, 256, shape, np.uint8))[1].tobytes()
        assert declared_size(data) == (cols, rows)
        assert declared_size(data[:4]) is None


def test_limits_can_be_raised_and_lowered(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    cv2.imwrite(str(tmp_path / "small.png"), np.full((30, 30), 255, np.uint8))
    assert load_plan(tmp_path / "small.png").rooms
    monkeypatch.setenv(VARIABLE, "image_pixels=800")
    with pytest.raises(MapError, match=r"raise it with LAYOUTEXPLORE_LIMITS=image_pixels=940"):
        load_plan(tmp_path / "small.png")
    monkeypatch.setenv(VARIABLE, "image_pixels=940, file_mb=1")
    assert load_plan(tmp_path / "small.png").rooms and limits().file_mb == 1
    for text, said in (
        ("image_pixel=5", "did you mean 'image_pixels'"),
        ("depth=-1", "above 0"),
        ("depth", "above 0"),
    ):
        monkeypatch.setenv(VARIABLE, text)
        with pytest.raises(ConfigError, match=said):
            limits()


def test_a_name_that_is_a_path_stays_in_its_folder(tmp_path: Path) -> None:
    outside, store = tmp_path / "outside", tmp_path / "store"
    plan = dataclasses.replace(two_rooms(), name=f"{outside}/x")
    save_plan(plan, tmp_path / "plan.geojson")
    explore_plan(load_plan(tmp_path / "plan.geojson"), make_agent("nearest"), coverages=(0.3,), store=store)
    assert not outside.exists() and len(list(store.glob("*.npz"))) == 1


def test_a_damaged_snapshot_is_named_and_made_anew(tmp_path: Path) -> None:
    plan = two_rooms()
    before = explore_plan(plan, make_agent("nearest"), coverages=(0.3,), store=tmp_path)
    (path,) = tmp_path.glob("*.npz")
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2] + b"\x55" + whole[len(whole) // 2 + 1 :])
    with pytest.warns(UserWarning, match="made anew"):
        again = explore_plan(plan, make_agent("nearest"), coverages=(0.3,), store=tmp_path)
    assert np.array_equal(again[0].decision.grid.cells, before[0].decision.grid.cells)
    assert path.read_bytes() == whole


@pytest.mark.skipif(sys.platform == "win32", reason="needs links")
def test_links_at_temporary_names_are_not_followed(tmp_path: Path) -> None:
    victim = tmp_path / "victim"
    victim.write_text("precious")
    for name in (f".a.txt.{os.getpid()}.tmp", ".a.txt.part"):
        (tmp_path / name).symlink_to(victim)
    with atomic(tmp_path / "a.txt") as temporary:
        assert not temporary.is_symlink()
        temporary.write_text("new")
    assert victim.read_text() == "precious" and (tmp_path / "a.txt").read_text() == "new"


@pytest.mark.skipif(sys.platform == "win32", reason="needs links and permissions")
def test_links_and_permissions_stay(tmp_path: Path) -> None:
    file, link, nowhere = tmp_path / "there" / "a.txt", tmp_path / "link", tmp_path / "nowhere"
    write_atomically(file, "old")
    link.symlink_to(file)
    nowhere.symlink_to(tmp_path / "new" / "b.txt")
    file.chmod(0o640)
    for path in (link, nowhere):
        write_atomically(path, "new")
        assert path.is_symlink() and path.resolve().read_text() == "new"
    assert stat.S_IMODE(file.stat().st_mode) == 0o640
    assert [p.name for p in file.parent.iterdir()] == ["a.txt"]
    file.chmod(0o400)
    write_atomically(file, "newer")
    assert file.read_text() == "newer" and stat.S_IMODE(file.stat().st_mode) == 0o400
    code = (
        "from layoutexplore.files import write_atomically; import os, pathlib, sys\n"
        "os.umask(int(sys.argv[1], 8)); write_atomically(pathlib.Path(sys.argv[2]), 'x')"
    )
    for umask, mode in (("077", 0o600), ("002", 0o664)):
        out = tmp_path / umask
        subprocess.run([sys.executable, "-c", code, umask, str(out)], check=True)
        assert stat.S_IMODE(out.stat().st_mode) == mode


@pytest.mark.skipif(sys.platform != "linux", reason="needs pipes and Linux's devices")
def test_devices_and_pipes_are_written_to_and_never_replaced(tmp_path: Path) -> None:
    pipe, device = tmp_path / "pipe", tmp_path / "device"
    os.mkfifo(pipe)
    with pytest.raises(WriteError, match="pipe: cannot write"):  # nobody reads
        write_atomically(pipe, "x")
    read: list[bytes] = []
    reader = threading.Thread(target=lambda: read.append(pipe.read_bytes()))
    reader.start()
    while True:  # until the reader has opened it
        with contextlib.suppress(WriteError):
            write_atomically(pipe, b"x" * 200_000)
            break
    reader.join()
    assert read == [b"x" * 200_000] and stat.S_ISFIFO(pipe.stat().st_mode)
    device.symlink_to("/dev/full")
    with pytest.raises(WriteError, match=r"device: cannot write: No space left"):
        write_atomically(device, "x")
    assert stat.S_ISCHR(device.stat().st_mode)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["device", "pipe"]


@pytest.mark.skipif(sys.platform != "linux", reason="needs /dev/stdout")
def test_standard_output_can_be_written_to(tmp_path: Path) -> None:
    code = (
        "from pathlib import Path; from layoutexplore.files import write_atomically\n"
        "write_atomically(Path('/dev/stdout'), 'x')"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, check=True)
    assert run.stdout == b"x" and Path("/dev/stdout").is_symlink()
    with (tmp_path / "a.txt").open("wb") as file:
        subprocess.run([sys.executable, "-c", code], stdout=file, check=True)
    assert (tmp_path / "a.txt").read_bytes() == b"x" and Path("/dev/stdout").is_symlink()


def test_values_of_an_archive_are_those_that_were_written(tmp_path: Path) -> None:
    path = tmp_path / "a.npz"
    write_arrays(path, {"x": np.arange(500), "y": np.ones((2, 3), np.float32)})
    whole = path.read_bytes()
    for place in range(len(whole)):
        path.write_bytes(whole[:place] + bytes([whole[place] ^ 0x41]) + whole[place + 1 :])
        try:
            found = read_arrays(path)
        except ResultsError as error:
            assert str(path) in str(error)
        else:
            assert np.array_equal(found["x"], np.arange(500)) and found["y"].tolist() == [[1.0] * 3] * 2
    other = io.BytesIO()
    np.savez(other, x=np.arange(501), **{CHECKSUM: np.load(io.BytesIO(whole))[CHECKSUM]})
    path.write_bytes(other.getvalue())
    with pytest.raises(ResultsError, match="checksum does not fit"):
        read_arrays(path)


def test_an_archive_that_unpacks_to_more_than_the_limit(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(VARIABLE, "array_mb=1")
    with zipfile.ZipFile(tmp_path / "bomb.npz", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("x.npy", b"\0" * 2_000_000)
    with pytest.raises(ResultsError, match="limit array_mb is 1"):
        read_arrays(tmp_path / "bomb.npz")


@pytest.mark.parametrize("value", [np.nan, np.inf, 3e38])
def test_a_policy_acts_on_finite_numbers_only(tmp_path: Path, value: float) -> None:
    path = tmp_path / "policy.safetensors"
    weights = dict(safetensors.numpy.load_file(find_policy("layout")))
    weights["direct.weight"] = np.full_like(weights["direct.weight"], value)
    safetensors.numpy.save_file(weights, path, metadata={"card": to_toml(read_card(find_policy("layout")))})
    simulation = Simulation("apartment-01", SimulationConfig())
    simulation.reset(seed=1)
    with pytest.raises(ResultsError, match="finite"):
        make_agent(f"policy:{path}").act(simulation.decision)


def test_what_a_card_says_is_shortened(tmp_path: Path) -> None:
    path = tmp_path / "policy.safetensors"
    weights = safetensors.numpy.load_file(find_policy("layout"))
    card = read_card(find_policy("layout"))
    card["policy"]["network"]["x" * 9000] = 1
    safetensors.numpy.save_file(weights, path, metadata={"card": to_toml(card)})
    with pytest.raises(ResultsError, match=r"is not understood: .*xxx") as caught:
        read_spec(path)
    assert len(str(caught.value)) < 1000


def test_a_network_starts_at_weights_of_its_precision() -> None:
    for name in ("tour_weight", "detour_weight"):
        with pytest.raises(ConfigError, match=f"network.{name}"):
            NetworkConfig(**{name: 1e300})


def test_many_grey_levels_side_by_side_are_told_apart_at_once() -> None:
    """As many levels as there are bytes, each a courtyard, and none where rows of two alternate."""
    levels = np.kron(np.arange(91, 226).reshape(9, 15), np.ones((20, 20))).astype(np.uint8)
    image = np.pad(np.pad(levels, 20, constant_values=254), 1)
    grid = grid_from_image(image, 0.3)
    assert (grid.cells[21:-21, 21:-21] == UNKNOWN).all()
    thin = np.where(np.indices(levels.shape)[0] % 2, levels, np.roll(levels, 20, axis=1))
    image[21:-21, 21:-21] = thin
    assert (grid_from_image(image, 0.3).cells[21:-21, 21:-21] != UNKNOWN).mean() > 0.9


def test_a_tangle_is_refused_before_it_is_cut() -> None:
    rng = random.Random(1)
    tangle = [(rng.random() * 50, rng.random() * 50) for _ in range(5000)]
    with pytest.raises(MapError, match=r"plan\.json: outlines cut across"):
        check_outlines("plan.json", [tangle])
    star = [(np.cos(k) * (20 + k % 7), np.sin(k) * (20 + k % 7)) for k in np.linspace(0, 6.28, 2000)]
    check_outlines("plan.json", [star, [(0, 0), (1, 0), (1, 1)], [(1, 0), (2, 0), (2, 1)]])


@pytest.mark.parametrize("shape", ["noise", "checkerboard", "rings"])
def test_images_that_cannot_be_rooms_are_refused(tmp_path: Path, shape: str) -> None:
    rng = np.random.default_rng(1)
    rows, cols = np.indices((800, 800))
    images = {
        "noise": rng.integers(0, 256, (800, 800, 3)),
        "checkerboard": np.where((rows + cols) % 2, 255, 0),
        "rings": np.maximum(abs(rows - 400), abs(cols - 400)) % 250 + 1,
    }
    cv2.imwrite(str(tmp_path / "x_occ.png"), np.full((800, 800), 255, np.uint8))
    cv2.imwrite(str(tmp_path / "x_rooms.png"), images[shape].astype(np.uint8))
    with pytest.raises(MapError, match=r"x_rooms\.png.*(limit|scattered)"):
        load_plan(tmp_path / "x_occ.png")


def test_room_ids_that_no_cell_can_hold(tmp_path: Path) -> None:
    save_plan(two_rooms(), tmp_path / "plan.geojson")
    text = (tmp_path / "plan.geojson").read_text()
    for number in ("2147483648", "1" * 400, "1" * 5000):
        (tmp_path / "plan.geojson").write_text(text.replace('"id": 1', f'"id": {number}'))
        with pytest.raises(MapError, match=r"plan\.geojson"):
            load_plan(tmp_path / "plan.geojson")


def test_half_a_character_in_a_name(tmp_path: Path) -> None:
    save_plan(two_rooms(), tmp_path / "plan.geojson")
    data = json.loads((tmp_path / "plan.geojson").read_text()) | {"name": "\ud800"}
    (tmp_path / "plan.geojson").write_text(json.dumps(data))
    with pytest.raises(MapError, match="half a character"):
        load_plan(tmp_path / "plan.geojson")


def test_trees_whose_ways_meet_again(tmp_path: Path) -> None:
    """With sixty forks that join again there are 2**60 ways down."""
    nodes = [[0, 0.5, k + 1, k + 1] for k in range(60)] + [[1.0]]
    forest = {"features": ["a"], "forests": {"x": {"bias": 0.0, "trees": [nodes]}}}
    (tmp_path / "trees.json").write_text(json.dumps(forest))
    with pytest.raises(ConfigError, match="no tree"):
        load_forests(tmp_path / "trees.json", ("a",))


@pytest.mark.parametrize("name", ["x" * 300, "a\0b", "y" * 5000])
def test_no_policy_and_no_new_file_has_a_name_that_no_file_can_have(name: str, tmp_path: Path) -> None:
    with pytest.raises(ConfigError):
        find_policy(f"{name}/policy.safetensors")
    with pytest.raises(WriteError, match="cannot write"), atomic(tmp_path / name):
        pass


def test_a_message_that_lists_names_stays_short() -> None:
    message = str(unknown_name("sensor", "mine", ["x" * 5000, *(f"name-{k}" for k in range(500))]))
    assert len(message) < 1500 and "more" in message
