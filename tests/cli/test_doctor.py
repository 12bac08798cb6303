import pytest
import torch

from openeureka.cli import doctor
from openeureka.cli.doctor import Finding
from openeureka.sandbox import confine


def test_the_doctor_never_prints_a_key(monkeypatch, capsys):
    monkeypatch.setattr(doctor, "LOOKS", (doctor.endpoint_key,))
    monkeypatch.setenv("OPENAI_API_KEY", "sk-secret")
    assert doctor.doctor() == 0
    text = capsys.readouterr().out
    assert "OPENAI_API_KEY is set" in text and "secret" not in text


@pytest.mark.parametrize(("needed", "code", "mark"), [(True, 1, "MISSING"), (False, 0, "absent")])
def test_only_what_a_run_needs_fails_the_doctor(needed, code, mark, monkeypatch, capsys):
    monkeypatch.setattr(doctor, "LOOKS", (lambda: Finding("thing", False, "install it", needed=needed),))
    assert doctor.doctor() == code
    assert capsys.readouterr().out == f"thing  {mark}  install it\n"


def test_installed_packages_are_found_and_missing_ones_said():
    assert all(doctor.package(name).good for name in doctor.PACKAGES)
    assert doctor.package("no-such-package") == Finding("no-such-package", False, "pip install no-such-package")


def test_gpus_are_counted_or_what_they_lack_is_said(monkeypatch):
    monkeypatch.setattr(torch.cuda, "device_count", lambda: 0)
    absent = doctor.gpus()
    assert not absent.good and not absent.needed and "use device=cpu" in absent.detail
    monkeypatch.setattr(torch.cuda, "device_count", lambda: 2)
    monkeypatch.setattr("openeureka.sim.find_spec", lambda _: object())
    monkeypatch.setattr("openeureka.sim._warp_gpus", lambda: 0)
    old = doctor.gpus()
    assert not old.good and "update the driver" in old.detail
    monkeypatch.setattr("openeureka.sim._warp_gpus", lambda: 2)
    assert doctor.gpus() == Finding("device=cuda", True, "trains on cuda:0, cuda:1")


@pytest.mark.parametrize(
    ("offered", "missing"),
    [
        (confine.Support("x86_64", 0, True), "the kernel offers no Landlock (Linux 5.13 or later"),
        (confine.Support("x86_64", 7, False), "the kernel offers no seccomp filter"),
        (confine.Support("riscv64", 7, True), "on riscv64"),
    ],
)
def test_the_doctor_names_what_the_kernel_lacks(offered, missing, monkeypatch, capsys):
    monkeypatch.setattr(doctor, "LOOKS", (doctor.confinement,))
    monkeypatch.setattr(confine, "support", lambda: offered)
    assert doctor.doctor() == 1
    text = capsys.readouterr().out
    assert text.startswith("sandbox  MISSING  generated code cannot be confined: ") and missing in text


def test_the_embedded_model_needs_its_engine_and_whole_weights(monkeypatch, tmp_path):
    missing = set(doctor.weights.QWEN.packages)
    monkeypatch.setattr(doctor, "_installed", lambda name: name not in missing)
    monkeypatch.setenv("EUREKA_CACHE", str(tmp_path))
    monkeypatch.delenv("EUREKA_GGUF", raising=False)
    (tmp_path / doctor.weights.QWEN.filename).touch()
    assert not doctor.embedded_model().good  # an empty file does not count
    (tmp_path / "mine.gguf").write_bytes(b"GGUF")
    monkeypatch.setenv("EUREKA_GGUF", str(tmp_path / "mine.gguf"))
    assert doctor.embedded_model() == Finding("model=local", True, f"EUREKA_GGUF names {tmp_path}/mine.gguf")
    missing.add("xllamacpp")
    assert not doctor.embedded_model().good
    missing.clear()
    monkeypatch.setenv("EUREKA_GGUF", str(tmp_path / "none.gguf"))
    finding = doctor.embedded_model()
    assert not finding.good and "EUREKA_GGUF names" in finding.detail


def test_a_user_without_a_home_still_gets_the_whole_list(monkeypatch):
    def none() -> None:
        raise RuntimeError("no home directory")

    monkeypatch.setattr(doctor, "_installed", lambda name: True)
    monkeypatch.setattr(doctor.weights.homes, "cache", none)
    monkeypatch.delenv("EUREKA_GGUF", raising=False)
    monkeypatch.delenv("EUREKA_CACHE", raising=False)
    finding = doctor.embedded_model()
    assert not finding.good and "set EUREKA_CACHE" in finding.detail


def test_the_page_names_what_to_install(monkeypatch):
    missing = {"uvicorn"}
    monkeypatch.setattr(doctor, "_installed", lambda name: name not in missing)
    finding = doctor.page()
    assert (finding.good, finding.needed) == (False, False)
    assert finding.detail == "uvicorn is missing; pip install 'openeureka[ui]'"
