"use strict";
// Without WebGL: the tracks from above on a plain canvas, north up where the scene has a north.

function plan() {
  const sheet = document.getElementById("view"), pen = sheet.getContext("2d");
  const down = given.down, across = down ? 1 : 0, up = down ? 0 : 1, place = [0, 0, 0];
  let scale = 1, middle = [0, 0];
  const at = (p, i = 0) => [sheet.width / 2 + scale * (p[i + across] - middle[0]), sheet.height / 2 - scale * (p[i + up] - middle[1])];
  function line(list, colour, dash, until = list.length) {
    pen.beginPath();
    for (let i = 0; i < until; i += 3) pen.lineTo(...at(list, i));
    pen.strokeStyle = colour; pen.setLineDash(dash); pen.stroke(); pen.setLineDash([]);
  }
  function draw() {
    const dots = window.devicePixelRatio || 1, followed = members[camera.follow];
    pen.fillStyle = css("--ground"); pen.fillRect(0, 0, sheet.width, sheet.height);
    pen.lineWidth = 2 * dots;
    scale = 0.8 * camera.zoom * Math.min(sheet.width, sheet.height) / (followed ? Math.max(extent.wide / 4, 1e-6) : Math.max(extent.wide, 1e-6));
    const target = followed ? placeOf(followed, followed.bodies[0], place) : extent.middle;
    middle = [target[across], target[up]];
    if (given.wayPoints.length) line(given.wayPoints.flat(), css("--faint"), [6, 4]);
    members.forEach(m => {
      const colour = standingOut(m.colour);
      m.bodies.forEach(b => {
        if (b.track) { pen.globalAlpha = 0.35; line(b.place, colour, []); pen.globalAlpha = 1; line(b.place, colour, [], 3 * m.index + 3); }
        const [x, y] = at(placeOf(m, b, place));
        pen.beginPath(); pen.arc(x, y, 5 * dots, 0, 7); pen.fillStyle = colour; pen.fill();
      });
    });
  }
  return {
    draw, recolour() {}, flat: true,
    resize() { const dots = window.devicePixelRatio || 1; sheet.width = sheet.clientWidth * dots; sheet.height = sheet.clientHeight * dots; },
    note: () => "seen from above: this browser has no WebGL",
  };
}
