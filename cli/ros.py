"""`bsg-ros`: a node of ROS 2 that hears what a robot sees, and says where the rest is."""

from __future__ import annotations

import click

from bsg_cli.terminal import Command
from bsg_data.errors import ask_to_install


@click.command("bsg-ros", cls=Command, context_settings={"ignore_unknown_options": True})
@click.argument("ros_args", nargs=-1, type=click.UNPROCESSED, metavar="[--ros-args ARG...]")
def main(ros_args: tuple[str, ...]) -> None:
    """Run a ROS 2 node that hears what a robot sees, and says where the rest is.

    It hears sightings and questions on topics below its name, `/belief`, and answers on
    /belief/answers, until Ctrl-C or SIGTERM stops it. docs/robot-software.md lists its topics,
    services and parameters.

    \b
    Example:
      bsg-ros
      bsg-ros --ros-args -p graph:=home.json -p state:=seen.json
    """
    if ros_args and ros_args[0] != "--ros-args":
        raise click.NoSuchOption(ros_args[0], possibilities=["--ros-args", "--help"])
    try:
        from bsg_robot.ros.node import run
    except ModuleNotFoundError as error:
        if str(error.name).startswith("bsg_"):
            raise
        raise ModuleNotFoundError(
            f"bsg-ros needs ROS 2, and Python does not find {error.name}; where ROS 2 is "
            "installed, source its setup file (source /opt/ros/*/setup.bash); elsewhere, "
            f"{ask_to_install('ros')}",
            name=error.name,
        ) from error
    run(ros_args)
