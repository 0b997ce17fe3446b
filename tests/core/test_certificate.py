"""A sphere's digital certificate: diameters with standard uncertainties, in both ways that D-SI words them."""

import pytest

from calib_core.captures.certificate import read_certificate
from calib_core.errors import InputError

HEAD = """<?xml version="1.0" encoding="UTF-8"?>
<dcc:digitalCalibrationCertificate xmlns:dcc="https://ptb.de/dcc"
 xmlns:si="https://ptb.de/si" schemaVersion="3.2.1">
 <dcc:administrativeData><dcc:coreData>
 <dcc:uniqueIdentifier>K-123</dcc:uniqueIdentifier>
 </dcc:coreData></dcc:administrativeData>
 <dcc:measurementResults><dcc:measurementResult><dcc:results><dcc:result><dcc:data>"""
TAIL = "</dcc:data></dcc:result></dcc:results></dcc:measurementResult></dcc:measurementResults>"
END = "</dcc:digitalCalibrationCertificate>"
FIRST = r"""<si:expandedUnc><si:uncertainty>0.0004</si:uncertainty><si:coverageFactor>2</si:coverageFactor>
 <si:coverageProbability>0.95</si:coverageProbability></si:expandedUnc>"""
SECOND = r"""<si:measurementUncertaintyUnivariate><si:expandedMU><si:valueExpandedMU>0.0004</si:valueExpandedMU>
 <si:coverageFactor>2.0</si:coverageFactor></si:expandedMU></si:measurementUncertaintyUnivariate>"""


def quantity(
    name: str = "Diameter", unit: str = r"\milli\metre", value: str = "38.0997", uncertainty: str = FIRST
) -> str:
    return (
        f"<dcc:quantity><dcc:name><dcc:content lang='en'>{name}</dcc:content></dcc:name><si:real>"
        f"<si:value>{value}</si:value><si:unit>{unit}</si:unit>{uncertainty}</si:real></dcc:quantity>"
    )


def certificate(*quantities: str) -> bytes:
    return (HEAD + "".join(quantities) + TAIL + END).encode()


@pytest.mark.parametrize("uncertainty", [FIRST, SECOND])
def test_diameter_and_its_standard_uncertainty(uncertainty: str) -> None:
    roundness = quantity("Roundness", value="0.0001")
    found = read_certificate(certificate(roundness, quantity("Durchmesser Kugel 1", uncertainty=uncertainty)))
    assert found.identifier == "K-123"
    (one,) = found.diameters
    assert (one.name, one.diameter_mm, one.sigma_mm, one.coverage_factor) == (
        "Durchmesser Kugel 1", 38.0997, 0.0002, 2.0,
    )  # fmt: skip


def test_other_units_and_several_spheres() -> None:
    in_metres = quantity(unit=r"\metre", value="0.0254", uncertainty="")
    found = read_certificate(certificate(quantity("Sphere 2, diameter"), in_metres)).diameters
    assert [(one.diameter_mm, one.sigma_mm) for one in found] == [(38.0997, 0.0002), (25.4, None)]
    in_micrometres = quantity(unit=r"\micro\metre", value="38099.7", uncertainty=FIRST.replace("0.0004", "0.4"))
    assert read_certificate(certificate(in_micrometres)).diameters[0].sigma_mm == pytest.approx(0.0002)


@pytest.mark.parametrize(
    ("unit", "value"),
    [
        (r"\kelvin\tothe{-1}", "11.5e-6"),
        (r"\micro\metre\metre\tothe{-1}\kelvin\tothe{-1}", "11.5"),
        ("1/K", "11.5E-6"),
    ],
)
def test_expansion_and_the_temperature_that_it_is_for(unit: str, value: str) -> None:
    expansion = quantity("Thermal expansion coefficient", unit, value, "")
    at = quantity("Bezugstemperatur", r"\kelvin", "293.15", "")
    while_measured = quantity("Temperature of the laboratory", r"\degreecelsius", "20.7", "")
    found = read_certificate(certificate(quantity(), while_measured, expansion, at))
    assert (found.equipment.expansion_per_k, found.equipment.reference_c) == (11.5e-6, 20.0)
    assert len(found.diameters) == 1
    assert read_certificate(certificate(quantity(), while_measured)).equipment.reference_c is None


@pytest.mark.parametrize(
    ("data", "said"),
    [
        (b"%PDF-1.7", "whole XML"),
        (certificate(quantity())[:-60], "whole XML"),
        (b"<html></html>", "DCC"),
        (b'<!DOCTYPE a [<!ENTITY b "c">]><a>&b;</a>', "entities"),
        (certificate(quantity("Roundness")), "a diameter"),
        (certificate(quantity(unit=r"\kelvin")), "a diameter"),
        (certificate(quantity(value="about 38")), "a number"),
        (certificate(quantity(value="-38.1")), "positive"),
        (certificate(quantity(uncertainty=FIRST.replace(">2<", ">0<"))), "coverage factor"),
    ],
)
def test_what_is_no_certificate_is_refused_with_a_reason(data: bytes, said: str) -> None:
    with pytest.raises(InputError, match=said):
        read_certificate(data)
