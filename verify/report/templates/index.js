"use strict";
// Sorts and filters the table of all scenarios. Without this script the page shows them unsorted, all of them.
(() => {
  const byId = (id) => document.getElementById(id);
  const table = byId("index"), body = table.tBodies[0], heads = [...table.tHead.rows[0].cells];
  const find = byId("index-find"), failing = byId("index-failing");
  const by = byId("index-by"), turn = byId("index-turn"), now = byId("index-now");
  const words = new Intl.Collator("en", { numeric: true, sensitivity: "base" });
  const isWord = heads.map((head) => head.dataset.sort === "Scenario");

  const value = (row, column) => {
    const text = row.cells[column].dataset.value;
    return text === undefined ? null : isWord[column] ? text : Number(text);
  };

  // What has no figure stays last, whichever way round; equals stay as they were.
  const compare = (column, sign) => (one, other) => {
    const [a, b] = [value(one, column), value(other, column)];
    if (a === null || b === null) return (a === null) - (b === null);
    return sign * (isWord[column] ? words.compare(a, b) : a - b);
  };

  const sorted = () => heads.findIndex((head) => head.hasAttribute("aria-sort"));

  const say = () => {
    const rows = [...body.rows], shown = rows.filter((row) => !row.hidden).length;
    const head = heads[sorted()], rising = head.getAttribute("aria-sort") === "ascending";
    now.textContent = `${shown} of ${rows.length} shown, by ${head.dataset.sort.toLowerCase()}, ${rising ? "rising" : "falling"}`;
    by.value = String(sorted());
  };

  const sort = (column, sign) => {
    heads.forEach((head) => head.removeAttribute("aria-sort"));
    heads[column].setAttribute("aria-sort", sign > 0 ? "ascending" : "descending");
    body.append(...[...body.rows].sort(compare(column, sign)));
    say();
  };

  const turned = (column) => (heads[column].getAttribute("aria-sort") === "ascending" ? -1 : 1);

  const filter = () => {
    const wanted = find.value.trim().toLowerCase();
    for (const row of body.rows)
      row.hidden = (failing.checked && row.dataset.standing !== "bad") || !row.textContent.toLowerCase().includes(wanted);
    say();
  };

  heads.forEach((head, column) => {
    const button = document.createElement("button");
    button.type = "button";
    button.className = "sort";
    button.append(...head.childNodes);
    head.append(button);
    button.addEventListener("click", () => sort(column, turned(column)));
    by.append(new Option(head.dataset.sort, String(column)));
  });
  by.addEventListener("change", () => sort(Number(by.value), 1));
  turn.addEventListener("click", () => sort(sorted(), turned(sorted())));
  find.addEventListener("input", filter);
  failing.addEventListener("change", filter);
  byId("index-controls").addEventListener("submit", (event) => event.preventDefault());
  byId("index-controls").hidden = false;
  filter(); // the browser may have kept what was typed
})();
