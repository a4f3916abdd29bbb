"""Installs hc_sim_rig in a colcon workspace; pip users install the whole suite from the root."""

from xml.etree import ElementTree

from setuptools import find_packages, setup

setup(
    name="hc_sim_rig",
    version=ElementTree.parse("package.xml").findtext("version"),
    packages=find_packages(include=["hc_sim_rig", "hc_sim_rig.*"]),
    package_data={"hc_sim_rig": ["py.typed", "scenarios/*.yaml"]},
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/hc_sim_rig"]),
        ("share/hc_sim_rig", ["package.xml"]),
    ],
    entry_points={
        "console_scripts": [
            "indenter = hc_sim_rig.node:main",
            "master = hc_sim_rig.master_node:main",
            "slave = hc_sim_rig.slave_node:main",
        ]
    },
    zip_safe=False,
    license="Apache-2.0",
)
