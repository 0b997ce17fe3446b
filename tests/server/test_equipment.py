"""The register of equipment: sessions refer to its pieces, and keep what it said."""

from io import BytesIO
from zipfile import ZipFile

import httpx

from tests.server.live_server import assert_problem

DCC = b"""<?xml version="1.0" encoding="UTF-8"?>
<dcc:digitalCalibrationCertificate xmlns:dcc="https://ptb.de/dcc" schemaVersion="3.2.1">
 <dcc:administrativeData><dcc:coreData><dcc:uniqueIdentifier>K-123</dcc:uniqueIdentifier>
 <dcc:endPerformanceDate>2026-02-27</dcc:endPerformanceDate></dcc:coreData>
 <dcc:items><dcc:item><dcc:name><dcc:content>Sphere 80 mm</dcc:content></dcc:name><dcc:model>Ceramic</dcc:model>
 <dcc:identifications><dcc:identification><dcc:issuer>customer</dcc:issuer><dcc:value>ours</dcc:value></dcc:identification>
 <dcc:identification><dcc:issuer>manufacturer</dcc:issuer><dcc:value>S-4711</dcc:value></dcc:identification>
 </dcc:identifications></dcc:item></dcc:items>
 <dcc:calibrationLaboratory><dcc:contact><dcc:name><dcc:content>Example Laboratory</dcc:content></dcc:name>
 </dcc:contact>
 </dcc:calibrationLaboratory></dcc:administrativeData></dcc:digitalCalibrationCertificate>"""
UR = {"pose_convention": "ur"}


def test_a_certificate_s_file_travels_with_the_session_and_its_archive(client: httpx.Client) -> None:
    made = client.post("/equipment", json={"kind": "sphere"}).json()["id"]
    client.put(f"/equipment/{made}/certificate", files={"file": ("K 123.xml", DCC)}).raise_for_status()
    cell = {**UR, "equipment": [{"kind": "sphere", "register_id": made}]}
    session = client.post("/sessions", json={"name": "certified", "cell": cell}).raise_for_status().json()
    (piece,) = session["cell"]["equipment"]
    file = piece["certificate"]["file"]
    assert file == f"certificates/{made}.xml"
    assert client.get(f"/sessions/{session['id']}/kept/{file}").content == DCC
    assert "certificate-file" not in codes_of_check(client, session["id"])
    client.put(f"/equipment/{made}/certificate", files={"file": ("new.xml", DCC.replace(b"K-123", b"K-9"))})
    packed = client.get(f"/sessions/{session['id']}/archive").raise_for_status().content
    with ZipFile(BytesIO(packed)) as archive:  # what was used does not change afterwards
        (name,) = (name for name in archive.namelist() if name.endswith(file))
        assert archive.read(name) == DCC
    zipped = {"Content-Type": "application/zip"}
    there = client.post("/archives", content=packed, headers=zipped).raise_for_status().json()["id"]
    assert client.get(f"/sessions/{there}/kept/{file}").content == DCC
    assert "certificate-file" not in codes_of_check(client, there)
    # Of another piece, or not there at all, it is told.
    wrong = [{**piece, "register_id": None, "serial": "S-1"}]
    client.patch(f"/sessions/{there}", json={"cell": {"equipment": wrong}}).raise_for_status()
    assert "certificate-file" in codes_of_check(client, there)
    wrong = [{"kind": "sphere", "certificate": {"file": "elsewhere.pdf"}}]
    client.patch(f"/sessions/{there}", json={"cell": {"equipment": wrong}}).raise_for_status()
    assert "certificate-file" in codes_of_check(client, there)


def codes_of_check(client: httpx.Client, session: str) -> list[str]:
    return [one["code"] for one in client.get(f"/sessions/{session}/check").json()["findings"]]


def test_a_certificate_is_read_whole_and_sessions_keep_what_the_register_said(
    client: httpx.Client,
) -> None:
    made = client.post("/equipment", json={"kind": "sphere", "certificate": {"due": "2020-01-01"}})
    assert (made.status_code, made.json()["overdue"]) == (201, True)
    here = f"/equipment/{made.json()['id']}"
    assert_problem(client.get(f"{here}/certificate"), 404, "Upload")
    read = client.put(f"{here}/certificate", files={"file": ("K-123.xml", DCC)}).raise_for_status().json()
    assert (read["name"], read["model"], read["serial"]) == ("Sphere 80 mm", "Ceramic", "S-4711")
    certificate = {"number": "K-123", "laboratory": "Example Laboratory", "issued": "2026-02-27"}
    assert read["certificate"] == {**certificate, "due": "2020-01-01", "file": "K-123.xml"}
    assert client.get(f"{here}/certificate").content == DCC
    cell = {**UR, "equipment": [{"kind": "sphere", "register_id": made.json()["id"]}]}
    session = client.post("/sessions", json={"name": "referring", "cell": cell}).raise_for_status().json()
    (piece,) = session["cell"]["equipment"]
    assert (piece["serial"], piece["certificate"]["number"]) == ("S-4711", "K-123")
    client.put(here, json={"kind": "sphere", "serial": "S-4712"}).raise_for_status()
    stored = client.get(f"/sessions/{session['id']}").json()["cell"]["equipment"]
    assert stored == [piece]  # what was used does not change afterwards
    again = client.patch(f"/sessions/{session['id']}", json={"cell": cell}).raise_for_status().json()
    assert again["cell"]["equipment"][0]["serial"] == "S-4712"
    change = next(one for one in client.get("/audit").json()["items"] if one["path"].endswith(here))["change"]
    assert (change["before"]["serial"], change["after"]["serial"]) == ("S-4711", "S-4712")
    client.delete(here).raise_for_status()
    assert_problem(client.post("/sessions", json={"cell": cell}), 404, "equipment")
    assert_problem(client.put(f"{here}/certificate", files={"file": ("a.pdf", b"%PDF")}), 404, "listed")
