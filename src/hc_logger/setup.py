"""Installs hc_logger in a colcon workspace; pip users install the whole suite from the root."""

from xml.etree import ElementTree

from setuptools import find_packages, setup

setup(
    name="hc_logger",
    version=ElementTree.parse("package.xml").findtext("version"),
    packages=find_packages(include=["hc_logger", "hc_logger.*"]),
    package_data={"hc_logger": ["py.typed"]},
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/hc_logger"]),
        ("share/hc_logger", ["package.xml"]),
    ],
    entry_points={
        "console_scripts": [
            "recorder = hc_logger.recorder_node:main",
            "player = hc_logger.player_node:main",
        ]
    },
    zip_safe=False,
    license="Apache-2.0",
)
