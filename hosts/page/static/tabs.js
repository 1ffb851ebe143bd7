// The two views of the page as tabs: arrow keys move between them, and the address remembers the one that is shown.

/** Makes tabs of the buttons in `list`; each shows the panel that it controls. Calls `shown` with its id. */
export function tabs(list, shown) {
  const all = [...list.children];
  const show = (tab) => {
    for (const one of all) {
      const is = one === tab;
      one.setAttribute("aria-selected", String(is));
      one.tabIndex = is ? 0 : -1;
      document.getElementById(one.getAttribute("aria-controls")).hidden = !is;
    }
    shown(tab.getAttribute("aria-controls"));
  };
  const choose = (tab) => {
    show(tab);
    tab.focus();
    history.replaceState(null, "", `${location.search}#${tab.getAttribute("aria-controls")}`);
  };
  list.addEventListener("click", ({ target }) => all.includes(target) && choose(target));
  list.addEventListener("keydown", (event) => {
    const at = all.indexOf(event.target);
    const to = { ArrowLeft: at - 1, ArrowRight: at + 1, Home: 0, End: all.length - 1 }[event.key];
    if (to === undefined || at < 0) return;
    event.preventDefault();
    choose(all[(to + all.length) % all.length]);
  });
  show(all.find((one) => `#${one.getAttribute("aria-controls")}` === location.hash) ?? all[0]);
}
