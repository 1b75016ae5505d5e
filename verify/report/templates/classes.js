// The table of homotopy classes: a class chosen here, or in another view, is marked here and in the still pictures.
(() => {
  "use strict";
  const table = document.getElementById("class-table");
  const told = document.getElementById("class-picked");
  const picks = [...table.querySelectorAll("button.pick")];
  const pictures = [...document.querySelectorAll("figure svg")].filter((svg) => svg.querySelector("[data-class]"));
  let chosen = null;

  const show = (rank) => {
    chosen = rank;
    const name = rank === null ? null : String(rank);
    for (const pick of picks) {
      const own = pick.dataset.class === name;
      pick.setAttribute("aria-pressed", String(own));
      pick.closest("tr").classList.toggle("chosen", own);
    }
    for (const svg of pictures) {
      for (const part of svg.querySelectorAll("[data-class]")) {
        part.classList.toggle("dimmed", name !== null && part.dataset.class !== name);
      }
    }
    told.textContent = name === null ? "" : `Class ${name} is shown; the others are dimmed.`;
  };

  const choose = (rank) => {
    show(rank);
    document.dispatchEvent(new CustomEvent("vnav:class", { detail: { rank, source: "classes" } }));
  };

  table.addEventListener("click", (event) => {
    const row = event.target.closest("tr[data-class]");
    const button = event.target.closest("button");
    if (row === null || (button === null && String(window.getSelection()))) return;
    const rank = Number(row.dataset.class);
    choose(rank === chosen ? null : rank);
  });
  document.addEventListener("keydown", (event) => {
    if (event.key === "Escape" && chosen !== null) choose(null);
  });
  document.addEventListener("vnav:class", (event) => {
    if (event.detail.source !== "classes") show(event.detail.rank);
  });
  table.classList.add("live");
})();
