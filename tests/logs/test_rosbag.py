"""Bags and rosbag2 databases, written by rosbags: the same numbers as from MCAP."""

from __future__ import annotations

import builtins

import numpy as np
import pytest
from mcap_build import MS, assert_drive, drive, ros_drive, store
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2

from vehnav.errors import LogError
from vehnav.logs.log import ReadOptions
from vehnav.logs.rosbag import read_rosbag

PLAIN = ReadOptions()


def bag1(path, d):
    types = store(1)
    with Writer1(path) as writer:
        for channel in ros_drive(d, 1):
            name = channel.schema[0].replace("/", "/msg/")
            connection = writer.add_connection(channel.topic, name, typestore=types)
            for log, _, payload in channel.messages:
                writer.write(connection, log, payload)
    return path


def bag2(path, d):
    types = store(2)
    with Writer2(path, version=8, storage_plugin=StoragePlugin.SQLITE3) as writer:
        for channel in ros_drive(d, 2):
            connection = writer.add_connection(channel.topic, channel.schema[0], typestore=types)
            for log, _, payload in channel.messages:
                writer.write(connection, log, payload)
    return path


def test_a_ros1_bag(tmp_path):
    d = drive()
    log = read_rosbag(bag1(tmp_path / "x.bag", d), PLAIN)
    assert_drive(log, d)
    assert not log.damaged
    assert {row["name"]: row["count"] for row in log.contents}["/imu/data"] == d.t.size
    np.testing.assert_array_equal(
        read_rosbag(tmp_path / "x.bag", ReadOptions(time="log")).imu.t_ns, d.t + MS
    )


def test_a_rosbag2_database_by_folder_and_by_file(tmp_path):
    d = drive()
    folder = bag2(tmp_path / "rec", d)
    assert_drive(read_rosbag(folder, PLAIN), d)
    assert_drive(read_rosbag(next(folder.glob("*.db3")), PLAIN), d)


def test_a_bag_that_was_cut_is_an_error_with_advice(tmp_path):
    path = bag1(tmp_path / "x.bag", drive())
    path.write_bytes(path.read_bytes()[:50_000])
    with pytest.raises(LogError, match="reindex"):
        read_rosbag(path, PLAIN)


def test_without_the_package_the_conversion_is_named(tmp_path, monkeypatch):
    original = builtins.__import__

    def without(name, *args, **kwargs):
        if name.startswith("rosbags"):
            raise ImportError(name)
        return original(name, *args, **kwargs)

    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(LogError, match=r"rosbags-convert --src .*x\.bag .*--dst-storage mcap"):
        read_rosbag(tmp_path / "x.bag", PLAIN)
    with pytest.raises(LogError, match=r"vehnav\[rosbag\]"):
        read_rosbag(tmp_path / "x.bag", PLAIN)
