"""Orphans in shared memory go, what is in use or older or of others stays."""

import fcntl
import os
import time
from pathlib import Path

from hc_bringup import shared_memory


def remove_orphans(folder: Path, domain_id: int, since: float = 0.0) -> int:
    return shared_memory.remove_orphans(folder, domain_id=domain_id, since=since, starting_s=0.0)


def make(folder: Path, name: str) -> None:
    for file in (name, f"{name}_el", f"sem.{name}_mutex"):
        (folder / file).write_bytes(b"x")


def names(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir()}


def test_removes_segments_and_ports_without_owner(tmp_path: Path) -> None:
    make(tmp_path, "fastrtps_0123")
    make(tmp_path, "fastrtps_port7000")
    (tmp_path / "something_else").write_bytes(b"x")
    assert remove_orphans(tmp_path, domain_id=3) == 2
    assert names(tmp_path) == {"something_else"}


def test_keeps_what_a_process_holds(tmp_path: Path) -> None:
    make(tmp_path, "fastrtps_0123")
    descriptor = os.open(tmp_path / "fastrtps_0123_el", os.O_RDONLY)
    fcntl.flock(descriptor, fcntl.LOCK_EX)
    try:
        assert remove_orphans(tmp_path, domain_id=3) == 0
        assert "fastrtps_0123" in names(tmp_path)
    finally:
        os.close(descriptor)
    assert remove_orphans(tmp_path, domain_id=3) == 1


def test_one_free_lock_of_two_is_not_enough(tmp_path: Path) -> None:
    make(tmp_path, "fastrtps_port1")
    (tmp_path / "fastrtps_port1_sl").write_bytes(b"x")
    descriptor = os.open(tmp_path / "fastrtps_port1_sl", os.O_RDONLY)
    fcntl.flock(descriptor, fcntl.LOCK_SH)
    try:
        assert remove_orphans(tmp_path, domain_id=3) == 0
    finally:
        os.close(descriptor)


def test_leaves_alone_what_is_older_than_the_run(tmp_path: Path) -> None:
    make(tmp_path, "fastrtps_0123")
    assert remove_orphans(tmp_path, domain_id=3, since=time.time() + 60.0) == 0
    assert remove_orphans(tmp_path, domain_id=3, since=time.time() - 60.0) == 1


def test_ports_without_any_lock_go_in_the_own_domain_only(tmp_path: Path) -> None:
    own, other = 7400 + 250 * 3 + 11, 7400 + 250 * 4 + 11
    for port in (own, other):
        (tmp_path / f"fastrtps_port{port}").write_bytes(b"x")
    assert remove_orphans(tmp_path, domain_id=3) == 1
    assert names(tmp_path) == {f"fastrtps_port{other}"}


def test_segments_without_any_lock_stay(tmp_path: Path) -> None:
    (tmp_path / "fastrtps_0123").write_bytes(b"x")
    assert remove_orphans(tmp_path, domain_id=3) == 0


def test_ports_of_the_own_domain_go_whatever_their_age(tmp_path: Path) -> None:
    make(tmp_path, f"fastrtps_port{7400 + 250 * 3 + 11}")
    assert remove_orphans(tmp_path, domain_id=3, since=time.time() + 60.0) == 1
    assert names(tmp_path) == set()


def test_what_a_participant_has_just_made_and_not_locked_yet_stays(tmp_path: Path) -> None:
    own = f"fastrtps_port{7400 + 250 * 3 + 11}"
    for name in ("fastrtps_0123", own):
        make(tmp_path, name)
    assert shared_memory.remove_orphans(tmp_path, domain_id=3) == 0
    old = time.time() - 2.0
    for path in tmp_path.iterdir():
        os.utime(path, (old, old))
    os.utime(tmp_path / f"{own}_el")  # the lock of a port that is being taken over
    assert shared_memory.remove_orphans(tmp_path, domain_id=3) == 1
    assert own in names(tmp_path)
