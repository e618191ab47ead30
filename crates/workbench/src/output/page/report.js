// Figures can be made as wide as the page. Everything is there without this.
for (const figure of document.querySelectorAll("figure")) {
  const button = document.createElement("button");
  const name = figure.querySelector(".file").textContent.replace(/[()]/g, "");
  const show = (wide) => {
    figure.classList.toggle("wide", wide);
    button.setAttribute("aria-pressed", String(wide));
  };
  button.type = "button";
  button.textContent = "Wide";
  button.setAttribute("aria-label", `Wide: ${name}`);
  button.addEventListener("click", () => show(!figure.classList.contains("wide")));
  show(false);
  figure.append(button);
}
