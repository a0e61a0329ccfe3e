"use strict";
// The summary is one page: of the drawings of the fit the tallest is shown with which all has room on A4 and on Letter;
// where none has, everything becomes smaller. What room is left then goes between the parts.
(() => {
  const room = (254 / 25.4) * 96; // px, of the paper that is less high, without its margins
  const width = 185; // mm, as in the style sheet
  const body = document.body, drawings = [...document.querySelectorAll("#fit figure")];
  const spare = () => room - document.documentElement.getBoundingClientRect().height;
  const fits = () => spare() >= 0;
  const show = (chosen) => drawings.forEach((drawing, i) => { drawing.hidden = i !== chosen; });
  const found = drawings.findIndex((_, i) => { show(i); return fits(); });
  if (found < 0) show(drawings.length - 1);
  for (let scale = 0.98; !fits() && scale > 0.4; scale -= 0.02) {
    body.style.zoom = scale;
    body.style.width = `${width / scale}mm`;
  }
  const main = document.querySelector("main");
  if (!body.style.zoom) main.style.minHeight = `${main.getBoundingClientRect().height + spare()}px`;
})();
