"""Under what circumstances it was captured."""

from calib_core.findings.code import Code

LENGTH_AT_TEMPERATURE = Code(
    "length-at-temperature",
    "note",
    text={
        "sphere": "At {temperature_c:.1f} °C the sphere's diameter is {length_mm:.4f} mm (±{sigma_mm:.4f} mm), "
        "{change_um:+.1f} µm from its certified one.",
        "bar": "At {temperature_c:.1f} °C the ball bar is {length_mm:.4f} mm long (±{sigma_mm:.4f} mm), "
        "{change_um:+.1f} µm from its certified length.",
    },
    by="kind",
    meaning="Sphere and ball bar expand with temperature; the stage was solved with their lengths as captured.",
    decided="The ball's temperature (`environment.ball_c` of the captures or the session), the expansion and the "
    "reference temperature (`cell.equipment`; 20 °C if it is not told). The thermometer counts with 0.5 K, the "
    "expansion with ± 10 %.",
    usual_causes="A workshop that is not at 20 °C.",
    since="0.2",
)

EXPANSION_UNKNOWN = Code(
    "expansion-unknown",
    "note",
    text="The ball's temperature is known ({temperature_c:.1f} °C), but not its expansion: its diameter is taken as "
    "certified.",
    to_do="Tell the sphere's expansion with the equipment: steel 11.5 · 10⁻⁶, ceramic 8 · 10⁻⁶ to 10 · 10⁻⁶ per kelvin.",
    meaning="Without the sphere's expansion its diameter cannot be given at the temperature of the captures.",
    decided="A temperature of the ball is told, and no `expansion_per_k` of a sphere.",
    usual_causes="A sphere without a data sheet.",
    since="0.2",
)

CERTIFICATE_FILE = Code(
    "certificate-file",
    "warning",
    text={
        "missing": "The certificate of {piece} is said to be in {file}, which is not in the session.",
        "differs": "The certificate in {file} is {found}, that of {piece} is told as {told}.",
    },
    by="what",
    to_do="Put the certificate of this piece into the session's folder under that name, or correct what is told of it.",
    meaning="Whoever checks traceability later finds another certificate than the one that is told, or none.",
    decided="`certificate.file` of a piece in `cell.equipment` names a file of the session. Where it is a digital "
    "certificate (DCC), its number and its item's serial number are compared with those that are told.",
    usual_causes="A file that was renamed or left behind, or last year's certificate.",
    since="0.2",
)

CERTIFICATE_OVERDUE = Code(
    "certificate-overdue",
    "warning",
    text="The certificate of {piece} was due on {due}, before the captures ({on}).",
    to_do="Have it calibrated, or enter its new certificate in the cell's equipment.",
    meaning="A reference whose certificate is overdue is not traceable on that day: its length may have changed.",
    decided="The certificate's `due` of a piece in `cell.equipment` lies before the day of the newest capture "
    "(`taken`); where no capture tells it, before the day of solving.",
    usual_causes="A recalibration that was forgotten, or a new certificate that was not entered.",
    since="0.2",
)
