import re

import pytest

from .serving import TOKEN, stranger, visitor

PATHS = [
    "/",
    "/style.css",
    "/page.js",
    "/compare",
    "/runs/x/",
    "/runs/x/candidates",
    "/runs/x/best/video.mp4",
    "/nothing",
]


@pytest.mark.parametrize("path", PATHS)
def test_nothing_is_served_without_the_token(tmp_path, path):
    answer = stranger(tmp_path).get(path)
    assert answer.status_code == 401
    assert answer.headers["www-authenticate"].startswith(
        "Basic "
    )  # so a browser asks for a token that is not in the address
    assert "the address that `eureka ui` printed" in answer.text


@pytest.mark.parametrize("token", ["", "wrong", TOKEN[:-1], TOKEN + "x", "ü", f"{TOKEN}:{TOKEN}"])
def test_a_wrong_token_opens_nothing(tmp_path, token):
    client = stranger(tmp_path)
    assert client.get("/", params={"token": token}).status_code == 401
    assert client.get("/", headers={"Cookie": f"openeureka={token}".encode()}).status_code == 401
    assert client.get("/", auth=("eureka", token)).status_code == 401


@pytest.mark.parametrize(
    "header", ["", "Basic", "Basic !", "Basic ZXVyZWth", "Bearer a-token", "Basic \xff", "basic " + "A" * 9999]
)
def test_an_odd_header_opens_nothing(tmp_path, header):
    assert stranger(tmp_path).get("/", headers={"Authorization": header.encode("latin-1")}).status_code == 401


def test_no_answer_leaves_a_cookie_which_every_port_of_this_machine_would_be_sent(tmp_path):
    client = visitor(tmp_path)
    for path in ("/open", f"/?token={TOKEN}", *PATHS):
        assert "set-cookie" not in client.get(path).headers
    assert stranger(tmp_path).get("/", headers={"Cookie": f"openeureka={TOKEN}"}).status_code == 401


def test_the_token_leaves_the_address(tmp_path):
    answer = visitor(tmp_path).get("/open")
    assert answer.status_code == 303
    assert answer.headers["location"] == "http://127.0.0.1:8080/"  # absolute: a relative one would keep the password


@pytest.mark.parametrize("site", ["cross-site", "same-site"])  # another port of this machine is the same site
def test_what_another_site_embeds_is_not_served_and_where_it_leads_a_person_is(tmp_path, site):
    client = visitor(tmp_path)
    navigated = {"Sec-Fetch-Site": site, "Sec-Fetch-Mode": "navigate"}
    assert client.get("/", headers={"Sec-Fetch-Site": site, "Sec-Fetch-Mode": "no-cors"}).status_code == 403
    for frame in ("iframe", "frame", "object", "embed"):
        assert client.get("/", headers={**navigated, "Sec-Fetch-Dest": frame}).status_code == 403
    assert client.get("/", headers={**navigated, "Sec-Fetch-Dest": "document"}).status_code == 200
    assert client.get("/", headers=navigated).status_code == 200  # from a browser that does not send Sec-Fetch-Dest
    assert client.get("/", headers={"Sec-Fetch-Site": "same-origin", "Sec-Fetch-Mode": "cors"}).status_code == 200


@pytest.mark.parametrize("host", ["evil.example", "evil.example:8080", "127.0.0.1.evil.example", "", "localhost@evil"])
def test_another_name_for_this_machine_is_refused(tmp_path, host):
    assert visitor(tmp_path).get("/", headers={"Host": host}).status_code == 400


@pytest.mark.parametrize("host", ["localhost:8080", "127.0.0.1", "[::1]:8080"])
def test_names_of_this_machine_are_served(tmp_path, host):
    assert visitor(tmp_path).get("/", headers={"Host": host}).status_code == 200


@pytest.mark.parametrize(
    "origin", ["http://evil.example", "null", "", "http://127.0.0.1:9090", "http://localhost:8080"]
)
@pytest.mark.parametrize("path", ["/start", "/runs/x/remarks"])
def test_a_form_of_another_site_is_refused(tmp_path, path, origin):
    answer = visitor(tmp_path).post(path, data={"env": "cartpole"}, headers={"Origin": origin})
    assert answer.status_code == 403
    assert not list(tmp_path.iterdir())


def test_a_form_larger_than_any_person_writes_is_refused(tmp_path):
    assert visitor(tmp_path).post("/start", content=b"x" * (2 << 20) + b"x").status_code == 413
    assert visitor(tmp_path).post("/start", content=iter([b"x"])).status_code == 411


def test_a_page_may_run_only_its_own_script_and_be_in_no_frame(tmp_path):
    headers = visitor(tmp_path).get("/").headers
    policy = headers["content-security-policy"]
    assert "default-src 'none'" in policy and "script-src 'self';" in policy and "frame-ancestors 'none'" in policy
    assert "unsafe" not in policy
    assert headers["x-content-type-options"] == "nosniff"


def test_style_and_script_are_kept_by_their_content_and_nothing_else_is(tmp_path):
    client = visitor(tmp_path)
    page = client.get("/")
    assert page.headers["cache-control"] == "no-store"
    for name in ("style.css", "page.js"):
        (address,) = re.findall(rf'"(/{name}\?v=[^"]+)"', page.text)
        answer = client.get(address)
        assert answer.headers["cache-control"] == "private, max-age=31536000"
        assert answer.headers["content-encoding"] == "gzip"
    assert page.headers["content-encoding"] == "gzip"
    assert "content-encoding" not in client.get("/", headers={"Accept-Encoding": "identity"}).headers
    assert stranger(tmp_path).get("/style.css").headers["cache-control"] == "no-store"
