import imageio_ffmpeg
import pytest

from openeureka.report import video
from openeureka.report.video import VideoUnavailable, render


def needs_rendering() -> None:
    try:
        video.renderer()
    except VideoUnavailable as error:
        pytest.skip(str(error))


def test_a_second_of_cartpole_is_a_video_of_one_second(tmp_path):
    needs_rendering()
    path = tmp_path / "video.mp4"
    path.write_bytes(render("cartpole", "random", seconds=1.0))
    frames, seconds = imageio_ffmpeg.count_frames_and_secs(str(path))
    assert (frames, round(seconds)) == (30, 1)


def test_without_opengl_one_sentence_says_what_to_install(monkeypatch):
    monkeypatch.setenv("MUJOCO_GL", "disabled")
    with pytest.raises(VideoUnavailable, match=r"no OpenGL to render with; install .*apt-get install libegl1"):
        render("cartpole", "zero", seconds=0.1)


def test_an_unknown_task_is_named_by_the_child(monkeypatch):
    needs_rendering()
    with pytest.raises(VideoUnavailable, match="There is no environment `cartpol`"):
        render("cartpol", "zero")
