"""Installs hc_evaluation in a colcon workspace; pip users install the whole suite from the root."""

from xml.etree import ElementTree

from setuptools import find_packages, setup

setup(
    name="hc_evaluation",
    version=ElementTree.parse("package.xml").findtext("version"),
    packages=find_packages(include=["hc_evaluation", "hc_evaluation.*"]),
    package_data={
        "hc_evaluation": [
            "py.typed",
            "reproduction/published.yaml",
            "reproduction/experiments/*.yaml",
            "rivals/*.cpp",
        ]
    },
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/hc_evaluation"]),
        ("share/hc_evaluation", ["package.xml"]),
    ],
    zip_safe=False,
    license="Apache-2.0",
)
