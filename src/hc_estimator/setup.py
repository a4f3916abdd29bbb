"""Installs hc_estimator in a colcon workspace; pip users install the whole suite from the root."""

from xml.etree import ElementTree

from setuptools import find_packages, setup

setup(
    name="hc_estimator",
    version=ElementTree.parse("package.xml").findtext("version"),
    packages=find_packages(include=["hc_estimator", "hc_estimator.*"]),
    package_data={"hc_estimator": ["py.typed"]},
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/hc_estimator"]),
        ("share/hc_estimator", ["package.xml"]),
    ],
    entry_points={
        "console_scripts": [
            "estimator = hc_estimator.node:main",
            "array_estimator = hc_estimator.ros.array_node:main",
        ]
    },
    zip_safe=False,
    license="Apache-2.0",
)
