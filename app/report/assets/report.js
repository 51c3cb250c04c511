// A choice shows the parts of a group that have its key, or all of them; what shows a mean of all has the key "all".
"use strict";

for (const choice of document.querySelectorAll("select[data-pick]")) {
  const parts = [...document.querySelectorAll(`[data-of="${choice.dataset.pick}"]`)];
  const show = () => {
    for (const part of parts) {
      const shown = part.dataset.key === choice.value || (choice.value === "all" && part.dataset.key !== "all");
      part.classList.toggle("off", !shown);
      part.closest("svg")?.classList.toggle("single", choice.value !== "all");
    }
  };
  choice.addEventListener("change", show);
  show();
}
