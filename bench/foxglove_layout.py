"""Layout of Foxglove for recordings, docs/foxglove-layout.json: the scene, the images, log and plots."""

import json
from pathlib import Path

import foxglove.layouts as fl
import tyro

from app.core.messages import ArmState, Outcome
from app.recording.format.channels import SURFACE_TOPIC, TOPICS, calibration_topic, color_topic, depth_topic
from app.recording.write.foxglove_messages import WORLD

_OUTPUT = Path(__file__).parents[1] / "docs" / "foxglove-layout.json"
_CAMERAS = ("camera0", "camera1")
_CLOUDS = {
    "/object/particles": "#4e98e2ff",
    SURFACE_TOPIC: "#b0b4bcff",
    "/object/predicted": "#e5a84bff",
    "/goal": "#8fd16aff",
    "/plan/predicted": "#c678dd99",
}
"""Clouds of points by their channels, and the colour of each."""
_LINES, _TOOL = ("/plan/branches", "/executed/path"), "/tool/pose"
_NEAREST_MM, _FARTHEST_MM = 500, 1300
"""Depth that is drawn black and white."""


def layout() -> fl.Layout:
    """The scene on the left, the images of the simulated cell's cameras on the right, and below log and plots."""
    views = [_image(color_topic(name), name) for name in _CAMERAS]
    depth = _image(depth_topic(_CAMERAS[0]), _CAMERAS[0], f"Depth of {_CAMERAS[0]}")
    plots = fl.TabContainer(
        tabs=[
            fl.TabItem(title="Log", content=fl.LogPanel(config=fl.LogConfig(topic_to_render="/log"))),
            fl.TabItem(title="Distance to the goal", content=_plot(TOPICS[Outcome], _OUTCOME)),
            fl.TabItem(title="Speed of the tool", content=_plot(TOPICS[ArmState], _SPEED)),
        ]
    )
    right = fl.SplitContainer(direction="column", items=[fl.SplitItem(content=view) for view in (*views, depth)])
    top = fl.SplitContainer(
        items=[fl.SplitItem(proportion=2, content=_scene()), fl.SplitItem(proportion=1, content=right)]
    )
    return fl.Layout(
        content=fl.SplitContainer(
            direction="column",
            items=[fl.SplitItem(proportion=3, content=top), fl.SplitItem(proportion=1, content=plots)],
        )
    )


_OUTCOME = {"before": "chamfer_before_m2", "predicted": "predicted_chamfer_m2", "after": "chamfer_after_m2"}
_SPEED = {axis: f"velocity[{index}]" for index, axis in enumerate("xyz")}


def _scene() -> fl.ThreeDeePanel:
    topics: dict[str, fl.BaseRendererTopicSettings] = {
        topic: fl.BaseRendererPointCloudTopicSettings(visible=True, point_size=4, color_mode="flat", flat_color=color)
        for topic, color in _CLOUDS.items()
    }
    topics |= {topic: fl.BaseRendererSceneUpdateTopicSettings(visible=True) for topic in _LINES}
    topics |= {_TOOL: fl.BaseRendererPoseTopicSettings(visible=True)}
    topics |= {calibration_topic(name): fl.BaseRendererCameraTopicSettings(visible=True) for name in _CAMERAS}
    return fl.ThreeDeePanel(
        title="Scene",
        config=fl.ThreeDeeConfig(
            follow_tf=WORLD,
            follow_mode="follow-none",
            topics=topics,
            layers={"table": fl.BaseRendererGridLayerSettings(visible=True, frame_id=WORLD, size=2, divisions=20)},
            camera_state=fl.ThreeDeeCameraState(
                distance=1.4, phi=50, theta_offset=90, target_offset=(0.55, 0.0, 0.0), perspective=True
            ),
        ),
    )


def _image(topic: str, camera: str, title: str | None = None) -> fl.ImagePanel:
    is_depth = topic == depth_topic(camera)
    return fl.ImagePanel(
        title=title or camera,
        config=fl.ImageConfig(
            image_mode=fl.ImageModeConfig(
                image_topic=topic,
                calibration_topic=calibration_topic(camera),
                min_value=_NEAREST_MM if is_depth else None,
                max_value=_FARTHEST_MM if is_depth else None,
            )
        ),
    )


def _plot(topic: str, fields: dict[str, str]) -> fl.PlotPanel:
    paths = [fl.PlotSeries(value=f"{topic}.{name}", label=label) for label, name in fields.items()]
    return fl.PlotPanel(config=fl.PlotConfig(paths=paths))


def write(output: Path = _OUTPUT) -> None:
    """Write the layout as Foxglove imports it."""
    output.write_text(json.dumps(json.loads(layout().to_json()), indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    tyro.cli(write)
