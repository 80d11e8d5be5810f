"use strict";
// A page that follows a file: it asks for its number, and takes over the content of a newer one.
(() => {
  const take = (page) => {
    const before = [...document.querySelectorAll(".viewer")].map((root) => root.viewer);
    for (const part of ["title", "h1", ".live"]) document.querySelector(part).replaceWith(page.querySelector(part));
    document.querySelectorAll(".viewer").forEach((root, k) => new Viewer(root, before[k]));
  };
  const read = async (path) => (await fetch(path, { cache: "no-store" })).text();
  const follow = async () => {
    const live = () => document.querySelector(".live");
    try {
      if (await read("/version") !== live().dataset.version) {
        take(new DOMParser().parseFromString(await read("/"), "text/html"));
      }
      live().classList.remove("ended");
    } catch { live().classList.add("ended"); }
    setTimeout(follow, 400);
  };
  follow();
})();
