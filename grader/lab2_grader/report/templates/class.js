// Sorts and filters the table of submissions. Without it the table stands as it is, by name.
"use strict";
(() => {
  const table = document.getElementById("class");
  const body = table.tBodies[0];
  const rows = [...body.rows];
  const words = document.getElementById("words");
  const which = document.getElementById("which");
  const count = document.getElementById("count");
  const texts = new Map(rows.map((row) => [row, row.textContent.toLowerCase()]));
  const show = () => {
    const wanted = words.value.toLowerCase().split(/\s+/).filter(Boolean);
    let shown = 0;
    for (const row of rows) {
      const fits = wanted.every((word) => texts.get(row).includes(word)) &&
        (!which.value || row.dataset.is.split(" ").includes(which.value));
      row.hidden = !fits;
      shown += fits;
    }
    count.textContent = `${shown} of ${rows.length} shown`;
  };
  const compare = new Intl.Collator(undefined, { numeric: true, sensitivity: "base" }).compare;
  const value = (row, column) => row.cells[column].dataset.by ?? row.cells[column].textContent.trim();
  [...table.tHead.rows[0].cells].forEach((head, column) => {
    const button = document.createElement("button");
    button.type = "button";
    button.append(...head.childNodes);
    head.append(button);
    button.addEventListener("click", () => {
      const down = head.getAttribute("aria-sort") === "ascending";
      for (const other of table.tHead.rows[0].cells) other.removeAttribute("aria-sort");
      head.setAttribute("aria-sort", down ? "descending" : "ascending");
      const number = head.classList.contains("n");
      rows.sort((one, other) => {
        const [a, b] = [value(one, column), value(other, column)];
        if (!a || !b) return !a - !b; // what has none comes last, whichever way
        return (number ? a - b : compare(a, b)) * (down ? -1 : 1);
      });
      body.append(...rows);
    });
  });
  document.getElementById("tools").hidden = false;
  words.addEventListener("input", show);
  which.addEventListener("change", show);
  show();
})();
