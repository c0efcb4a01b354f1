// Tables sort by a click on a head; figures tell values under the pointer and switch between before
// and after; folded parts open for the printer. Without it the page says all the same.
"use strict";

// Tables of the class "sortable".
const value = (row, column) => {
  const text = row.cells[column].dataset.value ?? row.cells[column].textContent.trim();
  if (text === "" || text === "\u2013") return null;
  const number = parseFloat(text.replace(/\u2212/g, "-").replace(/,/g, ""));
  return Number.isNaN(number) ? text.toLowerCase() : number;
};
const compared = (x, y, down) =>  // what is missing stands last, whichever way
  x === null ? (y === null ? 0 : 1) : y === null ? -1 : order(x, y) * (down ? -1 : 1);
const order = (x, y) => typeof x === typeof y ? (x < y ? -1 : x > y ? 1 : 0) : typeof x === "number" ? -1 : 1;
for (const table of document.querySelectorAll("table.sortable")) {
  const heads = [...table.tHead.rows[0].cells];
  heads.forEach((head, column) => {
    const button = document.createElement("button");
    button.type = "button";
    button.append(...head.childNodes);
    head.append(button);
    button.addEventListener("click", () => {
      const down = head.getAttribute("aria-sort") === "ascending";
      for (const other of heads) other.removeAttribute("aria-sort");
      head.setAttribute("aria-sort", down ? "descending" : "ascending");
      const rows = [...table.tBodies[0].rows];
      rows.sort((a, b) => compared(value(a, column), value(b, column), down));
      table.tBodies[0].append(...rows);
    });
  });
}

// Before and after.
for (const group of document.querySelectorAll(".switch")) {
  const buttons = [...group.querySelectorAll("button")];
  const figure = group.closest("figure");
  group.hidden = false;
  for (const button of buttons)
    button.addEventListener("click", () => {
      for (const other of buttons) other.setAttribute("aria-pressed", other === button);
      for (const part of figure.querySelectorAll("svg .before, svg .after"))
        part.style.display = part.classList.contains(button.dataset.hides) ? "none" : "";
    });
}

// Values under the pointer. A panel's box is in shares of the figure, its data in units of the axes.
const scaled = (v, log) => log ? Math.log10(v) : v;
const share = (v, [low, high], log) =>
  (scaled(v, log) - scaled(low, log)) / (scaled(high, log) - scaled(low, log));
const unshare = (s, [low, high], log) => {
  const v = scaled(low, log) + s * (scaled(high, log) - scaled(low, log));
  return log ? 10 ** v : v;
};
const written = v => v === null ? "\u2013" : String(Number(v.toPrecision(4))).replace("-", "\u2212");
const percent = p => `${Number((100 * p).toPrecision(2))} %`;
const nearest = (panel, x) => {
  let best = 0;
  const away = i => Math.abs(scaled(panel.at[i], panel.log[0]) - scaled(x, panel.log[0]));
  for (let i = 1; i < panel.at.length; i++) if (away(i) < away(best)) best = i;
  return best;
};
const risk = (panel, i, y) => {  // between which boundaries a stiffness lies
  const over = panel.boundaries.filter(row => row[i] !== null && row[i] <= y).length;
  if (over === 0) return `under ${percent(panel.risks[0])}`;
  if (over === panel.risks.length) return `over ${percent(panel.risks[over - 1])}`;
  return `${percent(panel.risks[over - 1])} to ${percent(panel.risks[over])}`;
};
for (const plot of document.querySelectorAll(".plot[data-readings]")) {
  const panels = JSON.parse(plot.dataset.readings);
  const image = plot.querySelector("svg, img");
  const line = document.createElement("div");
  const tip = document.createElement("div");
  line.className = "crosshair";
  tip.className = "tip";
  tip.setAttribute("role", "status");
  line.hidden = tip.hidden = true;
  plot.append(line, tip);
  let panel = null, place = 0;
  const show = (i, y) => {
    place = Math.min(Math.max(i, 0), panel.at.length - 1);
    const [left, top, width, height] = panel.box;
    const x = left + width * share(panel.at[place], panel.x, panel.log[0]);
    const unit = u => u && u !== "%" && u !== "\u00b0" ? ` ${u}` : u === "%" ? " %" : u;
    const lines = [`${panel.name}: ${written(panel.at[place])}${unit(panel.unit)}`];
    if (panel.boundaries && y !== undefined)
      lines.push(`risk here, K ${written(y)}: ${risk(panel, place, y)}`);
    for (const [name, u, values] of panel.rows)
      lines.push(`${name}: ${values.map(row => written(row[place])).join(" to ")}${unit(u)}`);
    tip.replaceChildren(...lines.map(text => {
      const row = document.createElement("div");
      row.textContent = text;
      return row;
    }));
    line.hidden = tip.hidden = false;
    const [w, h] = [image.clientWidth || image.getBoundingClientRect().width,
      image.clientHeight || image.getBoundingClientRect().height];
    Object.assign(line.style, {left: `${x * w}px`, top: `${top * h}px`, height: `${height * h}px`});
    const beside = x * w + 12 + tip.offsetWidth > w ? x * w - 12 - tip.offsetWidth : x * w + 12;
    Object.assign(tip.style, {left: `${Math.max(beside, 0)}px`, top: `${(top + 0.04 * height) * h}px`});
  };
  const hide = () => { line.hidden = tip.hidden = true; };
  plot.addEventListener("pointermove", event => {
    const area = image.getBoundingClientRect();
    const [x, y] = [(event.clientX - area.left) / area.width, (event.clientY - area.top) / area.height];
    panel = panels.find(({box: [l, t, w, h]}) => x >= l && x <= l + w && y >= t && y <= t + h) ?? null;
    if (panel === null) return hide();
    const [l, t, w, h] = panel.box;
    const at = nearest(panel, unshare((x - l) / w, panel.x, panel.log[0]));
    show(at, unshare(1 - (y - t) / h, panel.y, panel.log[1]));
  });
  plot.addEventListener("pointerleave", hide);
  plot.addEventListener("blur", hide);
  plot.addEventListener("keydown", event => {
    const step = {ArrowLeft: -1, ArrowRight: 1}[event.key];
    const other = {ArrowUp: -1, ArrowDown: 1}[event.key];
    if (event.key === "Escape") return hide();
    if (step === undefined && other === undefined) return;
    event.preventDefault();
    const now = panels.indexOf(panel);
    if (other !== undefined || now < 0) {
      panel = panels[(Math.max(now, 0) + (now < 0 ? 0 : other) + panels.length) % panels.length];
      return show(Math.min(place, panel.at.length - 1));
    }
    show(place + step);
  });
  const hint = plot.closest("figure").querySelector(".hint");
  if (hint) hint.hidden = false;
}

window.addEventListener("beforeprint", () => {
  for (const part of document.querySelectorAll("details")) part.open = true;
});
