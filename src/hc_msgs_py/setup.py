"""Installs hc_msgs_py in a colcon workspace; pip users install the whole suite from the root."""

from xml.etree import ElementTree

from setuptools import find_packages, setup

setup(
    name="hc_msgs_py",
    version=ElementTree.parse("package.xml").findtext("version"),
    packages=find_packages(include=["hc_msgs_py", "hc_msgs_py.*"]),
    package_data={"hc_msgs_py": ["py.typed", "*.xml"]},
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/hc_msgs_py"]),
        ("share/hc_msgs_py", ["package.xml"]),
    ],
    zip_safe=False,
    license="Apache-2.0",
)
