"""Builds packages of messages of ROS 2 that are not packed for pip into the Python environment that runs this.

    python .ci/ros2-messages.py FOLDER PACKAGE...

FOLDER has a folder of each package; a package may use those before it. Only what Fast DDS needs is built, without CMake and colcon.
"""

import subprocess
import sys
import sysconfig
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from tempfile import mkdtemp

import numpy
from rosidl_cli.command.helpers import generate_visibility_control_file, generator_arguments_file, legacy_generator_arguments
from rosidl_cli.command.translate.api import translate
from rosidl_generator_c import generate_c
from rosidl_generator_py import generate_py
from rosidl_generator_type_description import generate_type_hash
from rosidl_typesupport_c import generate_c as generate_typesupport
from rosidl_typesupport_fastrtps_c import generate_typesupport_fastrtps_c

PREFIX, SITE = Path(sys.prefix), Path(sysconfig.get_path("purelib"))
DDS = "rosidl_typesupport_fastrtps_c"


def generate(source, package, work):
    """The sources of a package in C and C++ go to `work`, those in Python to the environment."""
    paths = [path for kind in ["msg", "srv", "action"] for path in sorted((source / kind).glob(f"*.{kind}"))]
    files = [f"{source}:{path.relative_to(source)}" for path in paths]
    known = [path for path in [*(PREFIX / "share").glob("*/"), *work.glob("idl/*/")] if path.name != package]
    shared = work / "idl" / package
    idl = translate(package_name=package, interface_files=files, include_paths=[], output_format="idl", output_path=shared)
    found = [f"{shared}:{Path(path.split(':')[-1])}" for path in idl]
    c, py = work / "c" / package, SITE / package

    def run(generator, template, output, **further):
        further |= {"include_paths": [f"{path.name}:{path}" for path in known]}
        templates = PREFIX / "share" / template / "resource"
        arguments = legacy_generator_arguments(
            package_name=package, interface_files=found, include_paths=[], templates_path=templates, output_path=output
        )
        with generator_arguments_file(**arguments, **further) as path:
            return path and generator(path)

    run(generate_type_hash, "rosidl_generator_c", shared)
    types = [f"{path.split(':')[-1]}:{(shared / path.split(':')[-1]).with_suffix('.json')}" for path in found]
    for template in ["rosidl_generator_c", DDS]:
        name = f"{template}__visibility_control.h"
        resource = PREFIX / "share" / template / "resource" / f"{name}.in"
        generate_visibility_control_file(package_name=package, template_path=resource, output_path=c / "msg" / name)
    run(generate_c, "rosidl_generator_c", c, type_description_tuples=types)
    run(lambda path: generate_typesupport(path, [DDS]), "rosidl_typesupport_c", c)
    run(generate_typesupport_fastrtps_c, DDS, c)
    run(lambda path: generate_py(path, ["rosidl_typesupport_c"]), "rosidl_generator_py", py)
    for folder in [py, *py.glob("*/")]:
        (folder / "__init__.py").touch()


def main(folder, *packages):
    """The sources of all packages become one library, beside which each has its module."""
    work = Path(mkdtemp())
    for package in packages:
        generate(Path(folder).resolve() / package, package, work)
    include = [work / "c", SITE, *(PREFIX / "include").glob("*/"), PREFIX / "include", sysconfig.get_path("include"), numpy.get_include()]
    flags = ["-fPIC", "-w", "-O1", *(f"-I{path}" for path in include)]
    libraries = [f"-l:{path.name}" for path in (PREFIX / "lib").glob("lib*.so") if "_cpp" not in path.name]
    link = ["-shared", f"-L{PREFIX}/lib", *libraries, f"-Wl,-rpath,{PREFIX}/lib"]
    sources = [path for end in ["c", "cpp"] for path in (work / "c").glob(f"**/*.{end}")]
    sources += [path for package in packages for path in (SITE / package).glob("*/*.c")]

    def compile_one(source):
        to = work / (str(abs(hash(source))) + ".o")
        subprocess.run(["g++" if source.suffix == ".cpp" else "gcc", *flags, "-c", source, "-o", to], check=True)
        return to

    # Two compilers at a time leave room for the build beside.
    with ThreadPoolExecutor(2) as pool:
        objects = list(pool.map(compile_one, sources))
    own = PREFIX / "lib" / "libci_ros2_messages.so"
    subprocess.run(["g++", *objects, *link, "-o", own], check=True)
    for package in packages:
        entry = SITE / package / f"_{package}_s.ep.rosidl_typesupport_c.c"
        module = SITE / package / f"{package}_s__rosidl_typesupport_c.so"
        subprocess.run(["gcc", *flags, entry, own, *link, "-o", module], check=True)


main(*sys.argv[1:])
