/* The switch between versions in the header. It reads ../versions.js, which docs/versions.py writes beside the versions. */
"use strict";
(() => {
  const root = document.documentElement.dataset.content_root;
  const own = DOCUMENTATION_OPTIONS.VERSION;

  // From a disk no page may read another one, so the search shows titles alone there.
  if (location.protocol === "file:") DOCUMENTATION_OPTIONS.SHOW_SEARCH_SUMMARY = false;

  const load = (source) =>
    new Promise((done) => {
      const script = document.createElement("script");
      script.src = source;
      script.onload = script.onerror = done;
      document.head.append(script);
    });

  const entry = (version, url) => {
    const link = document.createElement("a");
    link.className = "dropdown-item list-group-item list-group-item-action py-1";
    link.setAttribute("role", "option");
    link.setAttribute("aria-selected", String(version === own));
    if (version === own) link.classList.add("active");
    link.dataset.version = version;
    link.textContent = version;
    link.href = `${root}../${url}`;
    return link;
  };

  // The same page of another version, if there is one; until that is known a link leads to its first page.
  const lead = async () => {
    const page = `${DOCUMENTATION_OPTIONS.pagename}.html`;
    for (const { version } of window.PAMID_VERSIONS ?? []) {
      await load(`${root}../${version}/pages.js`);
      if (!window.PAMID_PAGES?.[version]?.includes(page)) continue;
      for (const link of document.querySelectorAll(".version-switcher__menu a"))
        if (link.dataset.version === version) link.href = `${root}../${version}/${page}`;
    }
    document.documentElement.dataset.versions = "known";
  };

  document.addEventListener("DOMContentLoaded", async () => {
    const buttons = document.querySelectorAll(".version-switcher__button");
    for (const button of buttons) {
      button.firstChild.textContent = `${own} `;
      button.setAttribute("aria-label", `Version ${own}, choose another`);
      button.addEventListener("click", lead, { once: true });
    }
    await load(`${root}../versions.js`);
    for (const menu of document.querySelectorAll(".version-switcher__menu"))
      menu.append(...(window.PAMID_VERSIONS ?? []).map(({ version, url }) => entry(version, url)));
  });
})();
