"use strict";
// Sort a table by the column whose heading is pressed; numbers by value, words by the reader's alphabet, no number last.
function cellValue(cell) {
  return cell.dataset.value === undefined ? cell.textContent : Number(cell.dataset.value);
}

for (const button of document.querySelectorAll("th button")) {
  button.addEventListener("click", () => {
    const head = button.parentElement;
    const body = head.closest("table").tBodies[0];
    const column = head.cellIndex;
    const up = head.getAttribute("aria-sort") !== "ascending";
    const order = (a, b) => (typeof a === "number" ? a - b : a.localeCompare(b, undefined, { numeric: true }));
    const rows = [...body.rows].map((row) => [cellValue(row.cells[column]), row]);
    const lacking = (value) => Number(Number.isNaN(value));
    rows.sort(([a], [b]) => lacking(a) - lacking(b) || (lacking(a) ? 0 : up ? order(a, b) : order(b, a)));
    for (const other of head.parentElement.cells) other.removeAttribute("aria-sort");
    head.setAttribute("aria-sort", up ? "ascending" : "descending");
    body.append(...rows.map((row) => row[1]));
  });
}

// Give a table as CSV, in the order shown and with all digits, even where the page stands without the files beside it.
function csv(table) {
  const quoted = (words) => (/[",\n\r]/.test(words) ? `"${words.replaceAll('"', '""')}"` : words);
  const heads = [...table.tHead.rows[0].cells].map((cell) => cell.textContent);
  const rows = [...table.tBodies[0].rows].map((row) => [...row.cells].map((cell) => cell.dataset.value ?? cell.textContent));
  return [heads, ...rows].map((cells) => cells.map(quoted).join(",")).join("\n") + "\n";
}

for (const table of document.querySelectorAll("table[data-name]")) {
  const button = document.createElement("button");
  button.type = "button";
  button.className = "download";
  button.textContent = table.dataset.rows === undefined ? "Download CSV" : `Download these ${table.tBodies[0].rows.length} rows as CSV`;
  button.addEventListener("click", () => {
    const link = document.createElement("a");
    link.href = URL.createObjectURL(new Blob([csv(table)], { type: "text/csv;charset=utf-8" }));
    link.download = `${table.dataset.name}.csv`;
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 1000);
  });
  table.parentElement.nextElementSibling.append(" ", button); // the line that names the files beside the page
}

// On a narrow screen a figure is as wide as the page; pressed, it is large enough to read, and scrolls.
for (const plate of document.querySelectorAll(".plate")) {
  Object.assign(plate, { tabIndex: 0, title: "Press to enlarge on a small screen" });
  plate.addEventListener("click", () => plate.classList.toggle("large"));
  plate.addEventListener("keydown", (event) => {
    if (event.key === "Enter") plate.classList.toggle("large");
  });
}
