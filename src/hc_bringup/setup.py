"""Installs hc_bringup in a colcon workspace; pip users install the whole suite from the root."""

from glob import glob
from xml.etree import ElementTree

from setuptools import find_packages, setup

setup(
    name="hc_bringup",
    version=ElementTree.parse("package.xml").findtext("version"),
    packages=find_packages(include=["hc_bringup", "hc_bringup.*"]),
    package_data={
        "hc_bringup": [
            "py.typed",
            "dashboard/page/*",
            "report/page/*",
            "templates/filter/*",
            "templates/filter/*/*",
        ]
    },
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/hc_bringup"]),
        ("share/hc_bringup", ["package.xml"]),
        ("share/hc_bringup/config", glob("../../config/*.yaml")),
        ("share/hc_bringup/launch", glob("launch/*.launch.py")),
        ("share/hc_bringup/config/robots", glob("../../config/robots/*.yaml")),
        ("share/hc_bringup/config/layouts", glob("../../config/layouts/*")),
    ],
    entry_points={"console_scripts": ["hc = hc_bringup.entry:main"]},
    zip_safe=False,
    license="Apache-2.0",
)
