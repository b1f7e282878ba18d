/* A box above a long table: only rows that have all of its words are shown. Without this script the table is whole. */
document.addEventListener("DOMContentLoaded", () => {
  for (const table of document.querySelectorAll("article table")) {
    const rows = [...(table.tBodies[0]?.rows ?? [])];
    if (rows.length < 30) continue;
    const box = document.createElement("p");
    box.className = "filter";
    const field = document.createElement("input");
    field.type = "search";
    field.placeholder = "Show rows with ...";
    field.setAttribute("aria-label", "Show rows of the table that have these words");
    const count = document.createElement("span");
    count.setAttribute("role", "status");
    box.append(field, count);
    (table.closest(".pst-scrollable-table-container") ?? table).before(box);
    const texts = rows.map((row) => row.textContent.toLowerCase());
    field.addEventListener("input", () => {
      const words = field.value.toLowerCase().split(/\s+/).filter(Boolean);
      let shown = 0;
      rows.forEach((row, number) => {
        row.hidden = !words.every((word) => texts[number].includes(word));
        shown += !row.hidden;
      });
      count.textContent = words.length ? `${shown} of ${rows.length} rows` : "";
    });
  }
});
