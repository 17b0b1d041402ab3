// Starts the players and the choice between light and dark.

const THEMES = ["", "light", "dark"];
const THEME_NAMES = { "": "as the system", light: "light", dark: "dark" };

function startTheme(players) {
  const button = document.getElementById("theme");
  const redraw = () => players.forEach((player) => player.redraw());
  button.hidden = false;
  button.addEventListener("click", () => {
    const root = document.documentElement;
    const next = THEMES[(THEMES.indexOf(root.dataset.theme || "") + 1) % THEMES.length];
    if (next) root.dataset.theme = next;
    else delete root.dataset.theme;
    button.textContent = `Theme: ${THEME_NAMES[next]}`;
    redraw();
  });
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", redraw);
}

const players = Array.from(document.querySelectorAll(".player"), (root) => (root.player = new Player(root)));
startTheme(players);
// One after the other: several large ones at a time would stall the page.
(async () => {
  for (const player of players) await player.start();
})();
