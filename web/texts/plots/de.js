// German: plots, the keys and the glossary.

export const texts = Object.freeze({
  "plot.keys": "Pfeiltasten wechseln zwischen den Punkten, Enter wählt einen aus, + und − zoomen, 0 zeigt alles.",
  "plot.shown": "Gezeigte Größen",
  "plot.in_sigma": "In Standardabweichungen",
  "plot.in_mm": "Abstand in mm",
  "plot.caption_mm": "Wie weit die Kugel jeder Aufnahme von der Stelle liegt, an der alle anderen sie erwarten, in Millimetern. Kreuze sind nicht verwendete Aufnahmen.",
  "plot.caption_parts": "Dieselben Abstände in Anteilen: {parts}, in Millimetern. Kreuze sind nicht verwendete Aufnahmen.",
  "plot.parts_base": "x in Basis, y in Basis, z in Basis",
  "plot.parts_table": "quer zur Achse, um die Achse, längs der Achse",
  "plot.zoom_in": "Vergrößern",
  "plot.zoom_out": "Verkleinern",
  "plot.zoom_all": "Alles zeigen",
  "plot.rejected": "verworfen: {reason}",
  "keys.capture": "Nächste Aufnahme der simulierten Zelle",
  "keys.redo": "Wiederholen",
  "keys.step": "Einen Schritt öffnen",
  "keys.view": "Messen oder Ergebnis zeigen",
  "keys.dots": "Im Diagramm: zum nächsten Punkt",
  "keys.pick": "Im Diagramm: Aufnahme überall auswählen",
  "keys.exclude": "Im Diagramm: Aufnahme aus- oder einschließen",
  "keys.keys": "Diese Tasten zeigen",
});
