"use strict";
// Tables sort by a click on their heads; numbers as numbers, with any unit or error after them.
(() => {
  const value = (cell) => {
    const text = cell.textContent.trim().replace(/,(?=\d{3})/g, "").replace(/\u2212/g, "-");
    const number = /^[<>~≈]?\s*(-?\d*\.?\d+(?:e[-+]?\d+)?)\s*(?:±\s*\S+\s*)?(km|mm|µm|nm|kN|mN|kJ|mJ|µJ|ms|µs)?/i.exec(text);
    if (!number) return text;
    const units = { km: 1e3, mm: 1e-3, "µm": 1e-6, nm: 1e-9, kn: 1e3, mn: 1e-3, kj: 1e3, mj: 1e-3, "µj": 1e-6, ms: 1e-3, "µs": 1e-6 };
    return Number(number[1]) * (units[(number[2] || "").toLowerCase()] || 1);
  };
  const order = (a, b) => (typeof a === typeof b ? (typeof a === "number" ? a - b : a.localeCompare(b)) : typeof a === "number" ? -1 : 1);
  document.querySelectorAll("table.sorts").forEach((table) => {
    const heads = [...table.tHead.rows[0].cells];
    heads.forEach((head, k) => {
      const button = document.createElement("button");
      button.type = "button"; button.append(...head.childNodes); head.append(button);
      button.addEventListener("click", () => {
        const up = head.getAttribute("aria-sort") !== "ascending";
        heads.forEach((other) => other.removeAttribute("aria-sort"));
        head.setAttribute("aria-sort", up ? "ascending" : "descending");
        const rows = [...table.tBodies[0].rows].map((row) => [value(row.cells[k]), row]);
        rows.sort(([a], [b]) => (up ? order(a, b) : order(b, a)));
        table.tBodies[0].append(...rows.map(([, row]) => row));
      });
    });
  });
})();
