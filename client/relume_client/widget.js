/** The page's half of `LookWidget`: an image on a canvas, sliders, orbit. See widget.py for the messages. */

const STEPS = 1000;
const KEY_PIXELS = 20;
const ZOOM_PER_PIXEL = 1.001;
const KEYS = {
  ArrowLeft: [-KEY_PIXELS, 0, 1],
  ArrowRight: [KEY_PIXELS, 0, 1],
  ArrowUp: [0, -KEY_PIXELS, 1],
  ArrowDown: [0, KEY_PIXELS, 1],
  "+": [0, 0, 1 / 1.1],
  "-": [0, 0, 1.1],
};

/** Value of a slider's position 0…1. */
function valueAt({ minimum, maximum, scale }, t) {
  return scale === "log" ? minimum * (maximum / minimum) ** t : minimum + (maximum - minimum) * t;
}

function positionOf({ minimum, maximum, scale }, value) {
  return scale === "log" ? Math.log(value / minimum) / Math.log(maximum / minimum) : (value - minimum) / (maximum - minimum);
}

function makeSlider(control, index, send) {
  const row = document.createElement("label");
  row.style.cssText = "display: grid; grid-template-columns: 14em 1fr 5em; gap: 0.5em; align-items: center";
  const input = document.createElement("input");
  Object.assign(input, { type: "range", min: 0, max: STEPS, value: STEPS * positionOf(control, control.value) });
  const output = document.createElement("output");
  output.textContent = control.value.toPrecision(3);
  input.addEventListener("input", () => {
    const value = valueAt(control, Number(input.value) / STEPS);
    output.textContent = value.toPrecision(3);
    input.ariaValueText = output.textContent;
    send({ type: "edit", control: index, value });
  });
  row.append(control.label, input, output);
  return row;
}

/** Report drags, keys and the wheel, at most one message per animation frame. */
function addOrbit(canvas, send) {
  let pending = null;
  const turn = (x, y, zoom) => {
    if (pending === null) requestAnimationFrame(() => (send(pending), (pending = null)));
    const { x: x0, y: y0, zoom: zoom0 } = pending ?? { x: 0, y: 0, zoom: 1 };
    pending = { type: "orbit", x: x0 + x, y: y0 + y, zoom: zoom0 * zoom };
  };
  canvas.tabIndex = 0;
  canvas.style.cursor = "grab";
  canvas.style.touchAction = "none";
  canvas.addEventListener("pointerdown", (event) => canvas.setPointerCapture(event.pointerId));
  canvas.addEventListener("pointermove", (event) => {
    if (canvas.hasPointerCapture(event.pointerId)) turn(event.movementX, event.movementY, 1);
  });
  canvas.addEventListener("wheel", (event) => {
    event.preventDefault();
    turn(0, 0, ZOOM_PER_PIXEL ** event.deltaY);
  });
  canvas.addEventListener("keydown", (event) => {
    if (!(event.key in KEYS)) return;
    event.preventDefault();
    event.stopPropagation(); // the notebook's own shortcuts
    turn(...KEYS[event.key]);
  });
}

export default {
  render({ model, el }) {
    const canvas = document.createElement("canvas");
    canvas.style.cssText = "display: block; max-width: 100%";
    canvas.setAttribute("role", "img");
    canvas.setAttribute("aria-label", model.get("title"));
    const status = document.createElement("div");
    status.setAttribute("role", "status");
    status.textContent = "Connecting";
    const send = (message) => model.send(message);
    el.append(canvas, status, ...model.get("controls").map((control, index) => makeSlider(control, index, send)));
    if (model.get("can_orbit")) addOrbit(canvas, send);

    const show = async (content, buffers) => {
      if (content.type === "frame") {
        const image = await createImageBitmap(new Blob([buffers[0]], { type: `image/${content.format}` }));
        if (canvas.width !== image.width || canvas.height !== image.height) {
          Object.assign(canvas, { width: image.width, height: image.height });
        }
        canvas.getContext("2d").drawImage(image, 0, 0);
        send({ type: "shown" });
      }
      status.textContent = content.status;
    };
    model.on("msg:custom", show);
    send({ type: "ready" });
    return () => model.off("msg:custom", show);
  },
};
