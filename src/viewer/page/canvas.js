// The picture on the screen: two sides, a line between them, and the size that fits.

export class View {
  constructor(stage, canvas, slider) {
    Object.assign(this, { stage, canvas, slider, first: null, second: null, split: 0.5, isSplit: false });
    this.context = canvas.getContext("2d", { alpha: false });
  }

  // Pixels of a picture of this shape that fits the window, on the screen's own pixels.
  fit(width, height, ratio) {
    const box = this.stage.getBoundingClientRect();
    const scale = Math.min(box.width / width, box.height / height);
    const [w, h] = [Math.max(1, Math.floor(width * scale)), Math.max(1, Math.floor(height * scale))];
    Object.assign(this.canvas.style, {
      width: `${w}px`, height: `${h}px`,
      left: `${Math.round((box.width - w) / 2)}px`, top: `${Math.round((box.height - h) / 2)}px`,
    });
    const size = [Math.round(w * ratio), Math.round(h * ratio)];
    if (this.canvas.width !== size[0] || this.canvas.height !== size[1]) {
      [this.canvas.width, this.canvas.height] = size;
    }
    this.draw();
    return size;
  }

  put(side, bitmap) {
    const replaced = side === "both" ? ["first", "second"] : [side];
    const old = replaced.map((name) => this[name]);
    replaced.forEach((name) => { this[name] = bitmap; });
    // A bitmap holds memory until it is closed.
    new Set(old).forEach((bitmap) => {
      if (bitmap && bitmap !== this.first && bitmap !== this.second) bitmap.close();
    });
    this.draw();
  }

  draw() {
    const { canvas, context, first, second } = this;
    const { width, height } = canvas;
    const paint = (bitmap, from, to) => {
      if (!bitmap || to <= from) return;
      context.save();
      context.beginPath();
      context.rect(from, 0, to - from, height);
      context.clip();
      context.drawImage(bitmap, 0, 0, width, height);
      context.restore();
    };
    const at = this.isSplit ? Math.round(this.split * width) : width;
    context.imageSmoothingQuality = "high";
    paint(first, 0, at);
    paint(second, at, width);
    this.slider.hidden = !this.isSplit;
    this.slider.setAttribute("aria-valuenow", Math.round(100 * this.split));
    this.slider.style.left = `${canvas.offsetLeft + this.split * canvas.offsetWidth}px`;
  }

  move(split) {
    this.split = Math.min(1, Math.max(0, split));
    this.draw();
  }
}
