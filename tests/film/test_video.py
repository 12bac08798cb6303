import imageio_ffmpeg
import numpy as np
import pytest
import rendering

from openeureka.film import mp4, video
from openeureka.film.video import VideoUnavailable, render
from openeureka.worker import Frame


def test_a_part_of_a_second_of_cartpole_is_a_video_as_long_as_that(tmp_path):
    rendering.needed()
    path = tmp_path / "video.mp4"
    path.write_bytes(render("cartpole", "random", seconds=0.3))
    frames, seconds = imageio_ffmpeg.count_frames_and_secs(str(path))
    assert (frames, round(seconds, 1)) == (9, 0.3)


def test_two_policies_play_side_by_side_under_their_captions_in_any_browser():
    rendering.needed()
    clip = render("cartpole", "zero", beside="zero", captions=("a", "b"), seconds=0.1)
    assert b"avc1" in clip and clip.index(b"moov") < clip.index(b"mdat")  # H.264, plays while it loads
    pictures = mp4.frames(clip)
    assert pictures.shape == (3, 720, 1280, 3)
    left, right = np.split(pictures[0].astype(int), 2, axis=1)
    assert np.abs(left[80:] - right[80:]).mean() < 3  # they begin alike
    assert (left[16:60, 16:60] != right[16:60, 16:60]).any()


def test_a_long_film_is_given_the_time_that_it_takes(monkeypatch):
    given = []
    monkeypatch.setattr(video, "_first_that_works", lambda *_: given.append(_[2]) or ("egl", Frame({}, {"video": b""})))
    for settings in ({"seconds": 3.0}, {"seconds": 60.0}, {"seconds": 60.0, "timeout": 5.0}):
        render("ant", "random", **settings)
    assert given == [600.0, 3600.0, 5.0]


def test_a_film_that_ffmpeg_refuses_is_no_film():
    with pytest.raises(RuntimeError, match=r"ffmpeg ended with \d+: .*not divisible by 2"):
        mp4.encode([np.zeros((47, 63, 3), np.uint8)] * 3, rate=10)


def test_without_opengl_one_sentence_says_what_to_install(monkeypatch):
    monkeypatch.setenv("MUJOCO_GL", "disabled")
    with pytest.raises(VideoUnavailable, match=r"no OpenGL to render with; install .*apt-get install libegl1"):
        render("cartpole", "zero", seconds=0.1)


def test_what_is_chosen_is_tried_first_and_needs_not_be_there(monkeypatch):
    there = rendering.needed()
    for chosen in ("glfw", "no-such-thing"):
        monkeypatch.setenv("MUJOCO_GL", chosen)
        assert video.renderer() in (chosen, there)


def test_a_busy_machine_is_not_said_to_lack_opengl(monkeypatch):
    monkeypatch.setattr(video, "BACKGROUND_START", 0.0)
    with pytest.raises(video.NoRenderer, match="rendering did not begin within 0 s"):
        render("cartpole", "zero", seconds=0.1, background=True)


def test_an_unknown_task_is_named_by_the_child(monkeypatch):
    rendering.needed()
    with pytest.raises(VideoUnavailable, match="There is no environment `cartpol`"):
        render("cartpol", "zero")
