// Keeps the screen on while the page is seen. Browsers allow it on secure pages alone: elsewhere nothing happens.
function stay() {
  if (!document.hidden) navigator.wakeLock?.request("screen").catch(() => {});
}

document.addEventListener("visibilitychange", stay);
stay();
