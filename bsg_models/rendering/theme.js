/* The theme of a page: the system's, until the button `.theme` is pressed. Frames follow their page. */
const Theme = (() => {
  "use strict";
  const system = matchMedia("(prefers-color-scheme: dark)");
  const button = document.querySelector("button.theme");
  const frames = document.querySelectorAll("iframe");
  let chosen = "";

  /* "light" or "dark" where one was chosen, else "". */
  const choice = () => chosen;
  const isDark = () => chosen === "dark" || (chosen === "" && system.matches);

  function choose(theme) {
    chosen = theme === "light" || theme === "dark" ? theme : "";
    show();
  }
  function show() {
    const pages = [document, ...[...frames].map((frame) => frame.contentDocument)];
    for (const page of pages) {
      if (!page || !page.documentElement) continue;  // of another origin, or not there yet
      if (chosen) page.documentElement.dataset.theme = chosen;
      else delete page.documentElement.dataset.theme;
    }
    button.setAttribute("aria-pressed", isDark());
    document.dispatchEvent(new Event("theme"));
  }

  if (window.parent === window) {
    button.addEventListener("click", () => choose(isDark() ? "light" : "dark"));
    system.addEventListener("change", show);
    for (const frame of frames) frame.addEventListener("load", show);
    show();
  } else button.hidden = true;
  return { choice, choose };
})();
