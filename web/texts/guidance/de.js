// Deutsch. Was eine Zelle erreichen wird, das Fehlerbudget an einem Punkt, geplante Posen.

export const texts = {
  "guidance.number": "Eine Zahl eingeben.",

  "plan.title": "Zelle planen", "plan.how": "Was erreichbar ist, bevor etwas gekauft oder montiert wird: mit welcher Kugel, in wie vielen Aufnahmen und wo sie stehen soll.",
  "plan.scanner": "Scanner", "plan.near_mm": "Messbereich beginnt bei, mm", "plan.far_mm": "Messbereich endet bei, mm", "plan.near_width_mm": "Breite am Anfang, mm", "plan.far_width_mm": "Breite am Ende, mm",
  "plan.point_sigma_mm": "Rauschen eines Punktes, mm", "plan.pitch_mm": "Punktabstand, mm", "plan.mounting_mm": "Vom Flansch zum Scanner, mm",
  "plan.cell": "Arm, Kugel und Ziel", "plan.arm": "Arm", "plan.arm_ordinary": "Üblich", "plan.arm_calibrated": "Mit vermessener Kinematik", "plan.arm_nominal": "Groß, wie geliefert",
  "plan.sphere_class": "Güte der Kugel", "plan.sphere_certified": "Mit Kalibrierschein", "plan.sphere_bearing": "Lagerkugel", "plan.sphere_coated": "Matt beschichtet", "plan.sphere_turned": "Gedreht oder gedruckt",
  "plan.sphere_diameter_mm": "Kugeldurchmesser, mm (leer: übliche probieren)", "plan.wanted_mm": "Gewünschtes ± am Werkstück, mm",
  "plan.table": "Mit Drehtisch", "plan.table_radius_mm": "Werkstück reicht von der Achse bis, mm", "plan.table_height_mm": "Höhe des Werkstücks, mm", "plan.table_angle_sigma_deg": "Standardabweichung des Winkels, °",
  "plan.go": "Planen", "plan.wait": "Plane …", "plan.seen": "Der Scanner soll die Kugel in {distance} mm sehen, die Linie {offset} mm neben ihrer Mitte.", "plan.limited": "Mehr Aufnahmen helfen nicht gegen: {by}.",
  "plan.sphere": "Kugel", "plan.captures": "Aufnahmen", "plan.then": "± danach", "plan.off_axis": "Neben der Achse", "plan.heights": "Höhen", "plan.angles": "Winkel je Höhe",

  "budget.title": "Fehlerbudget", "budget.how": "Was jede Quelle zu einem gemessenen Punkt beiträgt, an einem gewählten Punkt: im Koordinatensystem des Drehtischs bei Winkel null; ohne Tisch dort, wo der Scanner ihn sieht.",
  "budget.axis": "{axis}, mm", "budget.go": "Zeigen", "budget.one_scan": "{one} für einen Scan, {many} bei beliebig vielen gemittelten (k = 2, ungünstigste Richtung).",
  "budget.part": "Quelle", "budget.rms": "Standardabweichung", "budget.worst": "Ungünstigste Richtung", "budget.kind": "Über Scans", "budget.shared": "in jedem Scan gleich", "budget.averages": "mittelt sich heraus",
  "budget.part_tool": "Scanner am Flansch (TCP)", "budget.part_scanner": "Eigene Fehler des Scanners", "budget.part_table": "Drehtisch", "budget.part_arm": "Arm, eigene Streuung", "budget.part_arm_alike": "Arm, gleich bei ähnlichen Posen (hebt sich teils auf)", "budget.part_angle": "Winkel des Tischs", "budget.part_points": "Rauschen eines Punktes", "budget.part_camera": "Kamera", "budget.part_plane": "Lichtebene",
  "budget.within": "95 % der Fehler liegen innerhalb ± {within} (x, y, z).", "budget.offset": "Liegt bekanntermaßen um {offset} daneben (x, y, z), weil gefundene Fehler des Scanners in seinen Dateien bleiben.",
  "budget.cancel": "Gemeinsam bestimmt: Ihre Fehler heben einander um {amount} auf.", "budget.add_up": "Gemeinsam bestimmt: Ihre Fehler verstärken einander um {amount}.", "budget.stale": "Dieses Ergebnis ist veraltet: neu lösen.",
  "budget.height": "Höhe über dem Tisch", "budget.picture": "Unsicherheit über dem Tisch, von {least} bis {most}", "budget.pick": "Klicken wählt einen Punkt. Blass ist {least}, volle Farbe {most}.",

  "planned.title": "Geplante Posen", "planned.how": "Posen, die zusammen die kleinste Unsicherheit am Werkstück lassen, die hilfreichste zuerst.",
  "planned.step": "Für", "planned.step_tcp": "den TCP", "planned.step_turntable": "den Drehtisch", "planned.step_verify": "eine Überprüfung",
  "planned.pose": "Flansch in der Basis ({convention})", "planned.brand": "Steuerung", "planned.save": "Als Programm speichern", "planned.saved": "{name} ist gespeichert.",
  "planned.safety": "Das Programm fährt mit dem Flansch, langsam, von weit außen, und hält vor jeder Bewegung, bis der Bediener sie startet. Im Handbetrieb verwenden.",

  "arm.unknown": "nicht bekannt", "arm.urdf": "Aus einer URDF …", "arm.taken": "{source}: {count} Gelenke",
  "certificate.taken": "{name} aus Kalibrierschein {number} übernommen.", "certificate.several": "Kalibrierschein {number} hat mehrere Durchmesser; {name} ist übernommen. Prüfen, ob es der richtige ist.",
};
