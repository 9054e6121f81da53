// Served by `retraverse view`, a page asks whether the study has new runs. From disk it asks nothing.
(() => {
  if (!location.protocol.startsWith("http")) return;
  const { one } = widgets;
  const news = document.getElementById("news");
  const always = one('[data-news="always"]', news);
  const remembered = "retraverse-follow";
  always.checked = sessionStorage.getItem(remembered) === "yes";
  always.addEventListener("change", () =>
    sessionStorage.setItem(remembered, always.checked ? "yes" : ""));
  one('[data-news="reload"]', news).addEventListener("click", () => location.reload());

  const ask = async () => {
    try {
      const answer = await fetch("status.json", { cache: "no-store" });
      const status = await answer.json();
      news.hidden = !status.news;
      if (status.news && always.checked && !document.getElementById("run").open) {
        location.reload();
      }
    } catch {
      // The server was stopped: the page stays as it is.
    }
    setTimeout(ask, 2000);
  };
  setTimeout(ask, 500);
})();
