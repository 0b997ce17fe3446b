"""What the camera stage notices: its model, its views, and what frames of a board cannot tell."""

from calib_core.findings.code import Code, Plural

FRAME_NOT_USED = Code(
    "frame-not-used",
    "note",
    text=Plural(
        "{captures} is not used: need {need}, got {got}.",
        "{captures} are not used: need {need}, got {got} (so in {first}; the others alike).",
    ),
    to_do="{to_do}",
    reason="need {need}, got {got}. {to_do}",
    meaning="A frame does not show board or stripe; enough others do.",
    decided="Board and stripe are looked for in every frame.",
    usual_causes="A board that leaves the image, glare, blur, a frame that is too dark.",
)

VIEW_NOT_USED = Code(
    "view-not-used",
    "note",
    text={
        "camera": Plural(
            "{captures} is not used: its corners lie {off_px:.2f} px from their predicted places, those of other views "
            "{others_px:.2f} px: the board moved, is bent or was misread.",
            "{captures} are not used: their corners lie farther from their predicted places than those of other views "
            "({off_px:.2f} px in the first, {others_px:.2f} px in others): the boards moved, are bent or were misread.",
        ),
        "place": Plural(
            "{captures} is not used: the board is bent, and nothing tells which of its corners are seen.",
            "{captures} are not used: the board is bent, and nothing tells which of its corners are seen.",
        ),
        "board": Plural(
            "{captures} is not used: its points are {off_px:.0f} px off a flat board in perspective: they were misread.",
            "{captures} are not used: their points are off a flat board in perspective ({off_px:.0f} px in the first): "
            "they were misread.",
        ),
        "robot": Plural(
            "{captures} is not used: it contradicts all others: its pose is not its own, or the board moved.",
            "{captures} are not used: they contradict all others: their poses are not their own, or the board moved.",
        ),
    },
    reason={
        "camera": "its corners lie {off_px:.2f} px from their predicted places, those of other views {others_px:.2f} "
        "px: the board moved, is bent or was misread",
        "place": "the board is bent, and nothing tells which of its corners are seen",
        "board": "its points are {off_px:.0f} px off a flat board in perspective: they were misread",
        "robot": "it contradicts all others: its pose is not its own, or the board moved",
    },
    by="off",
    meaning="One view contradicts the camera that all others agree on, or is no board; it is left out.",
    decided="The median distance of its corners is several times that of the other views, and above 0.2 px; or its "
    "points are far from any flat board in perspective.",
    usual_causes="A board that was held by hand, a rolling shutter, corners that were taken for others.",
)

BOARD_NOT_AS_TOLD = Code(
    "board-not-as-told",
    "warning",
    text=Plural(
        "{captures} shows another board than cell.board tells: need {need}, got {got}.",
        "{captures} show another board than cell.board tells: need {need}, got {got}.",
    ),
    to_do="{to_do}",
    reason="need {need}, got {got}. {to_do}",
    meaning="Corners are numbered by what is told of the board; where that is wrong, most frames are refused, and those "
    "that are taken may have their corners in wrong places.",
    decided="The frame shows how many squares or circles the board has, its kind or its markers, and a quarter of the "
    "frames or more contradict what is told.",
    usual_causes="Squares counted for corners, another kind or dictionary chosen, a mirrored image.",
)

FEW_FRAMES_USED = Code(
    "most-frames-not-used",
    "warning",
    behind=("board-not-as-told",),
    text="Only {used} of {count} frames could be used.",
    to_do="Look at what is said of the others, and take them again.",
    meaning="Where most frames are of no use, something is wrong with all of them.",
    decided="Fewer than half of the frames that should show the board are used.",
    usual_causes="A wrong number of columns and rows in cell.board, an exposure that suits few frames.",
)

CAMERA_NOT_CONVERGED = Code(
    "camera-not-converged",
    "warning",
    text="The adjustment did not converge: the views barely determine this model.",
    to_do="Take more views.",
    meaning="The last steps of the adjustment still changed the camera.",
    decided="The adjustment reached its largest number of steps.",
    usual_causes="Few views, or views that are alike.",
)

FEW_VIEWS = Code(
    "few-views",
    "warning",
    behind=("board-not-as-told",),
    text=Plural("Only {count} view is used.", "Only {count} views are used.", by="count"),
    to_do="Take at least 10, better 15 to 25.",
    meaning="With few views a wrong one is not found out, and the camera is known badly.",
    decided="Fewer than 10 views are used.",
    usual_causes="A short series, or frames of which many show no board.",
)

IMAGE_NOT_COVERED = Code(
    "image-not-covered",
    "warning",
    text="The boards cover {covered:.0%} of the image: the distortion of the rest is extrapolated.",
    to_do="Show the board in the corners too.",
    meaning="Where no board was seen the distortion is a guess.",
    decided="Of 8 × 6 cells of the image fewer than 60 % hold a corner, and the projection's uncertainty somewhere is above "
    "0.25 px and 3 times its median, terms of the lens that are left at zero taken as uncertain. With a plane of light only "
    "where it is seen counts, at the distances of the boards.",
    usual_causes="Boards in the middle of the image alone.",
)

IMAGE_COVERED_IN_PART = Code(
    "image-covered-in-part",
    "note",
    text="The boards cover {covered:.0%} of the image; the projection's uncertainty is nowhere more than {ratio:.1f} times "
    "its median.",
    meaning="Boards were not seen everywhere, but where they were they fix the distortion of what is used.",
    decided="Of 8 × 6 cells of the image fewer than 60 % hold a corner, and the projection's uncertainty is nowhere above "
    "0.25 px or 3 times its median, terms of the lens that are left at zero taken as uncertain; or a plane of light "
    "follows, whose result tells of the part that is used.",
    usual_causes="Few boards, spread over the image.",
)

BOARDS_NOT_TILTED = Code(
    "boards-not-tilted",
    "warning",
    text="No board is tilted by more than {tilt_deg:.0f}°: focal length and distance are hard to tell apart.",
    to_do="Tilt it by 20 to 45° in some views.",
    meaning="A board seen squarely looks the same nearer with a shorter focal length.",
    decided="The largest tilt of any board is below 15°.",
    usual_causes="Boards that were shifted, but not tilted.",
)

DISTORTION_FOLDS = Code(
    "distortion-folds",
    "warning",
    text="The distortion turns back before the image's corners, where no board was seen: pixels there give no points.",
    to_do="Show the board in the corners too.",
    meaning="The distortion's formula holds where boards were seen; beyond it folds back.",
    decided="A corner of the image has no ray.",
    usual_causes="A wide lens with boards in the middle alone.",
)

FOCAL_LENGTH_UNSURE = Code(
    "focal-length-unsure",
    "warning",
    text="The focal length is known only to ±{share:.1%} (k = 2).",
    to_do="Tilt the board more.",
    meaning="All distances scale with the focal length.",
    decided="Its standard deviation is above 0.5 %.",
    usual_causes="Few views, or boards that are hardly tilted.",
)

BOARD_BENT = Code(
    "board-bent",
    "warning",
    text="The board seems to be bent by {bend_mm:.2f} mm: the residuals would be {gain:.0%} smaller.",
    to_do='Take a flatter board, or leave "flat" out of cell.board to have its shape solved where views ask for it.',
    meaning="Corners that do not lie in one plane bend the camera's distortion.",
    decided="A board whose shape is free leaves residuals that are more than 15 % smaller.",
    usual_causes="Paper on a board that is not flat, a board that warped.",
)

BOARD_SHAPE_SOLVED = Code(
    "board-shape-solved",
    "note",
    text="The board is bent by {bend_mm:.2f} mm, highest to lowest point; its shape was solved, too.",
    meaning="Held-out views are met better with a board that may be bent, or cell.board.flat is false.",
    decided="Views that have no part in the fit are foretold significantly better with the board's shape free, or the cell "
    "says that it is not flat.",
)

PITCHES_DIFFER = Code(
    "board-pitches-differ",
    "warning",
    text="The board's pitch along its columns is {ratio:.4f} ± {uncertainty:.4f} of the told one where that along its rows "
    "is right: with the pitches as told fx / fy is {focal_ratio:.4f}, and a camera's pixels are square. The stated "
    "uncertainty holds the difference.",
    to_do="Measure the pitch over several squares in both directions, and set cell.board.pitch_mm and "
    "cell.board.pitch_y_mm.",
    meaning="A board that was printed wider or higher than told makes focal lengths and distances wrong.",
    decided="The ratio that makes fx and fy alike differs from the told one by more than 5 standard deviations and by more "
    "than 0.4 %.",
    usual_causes="A printer that feeds the paper in another scale, a scan or photograph of a board, a picture fitted to the "
    "page.",
)

CORNERS_OFF = Code(
    "corners-off-prediction",
    "warning",
    text="The corners lie {rms_px:.1f} px RMS from their predicted places, where 0.05 to 0.5 px is usual.",
    to_do="Check that the board is flat and still, and its columns and rows.",
    meaning="The camera does not explain where the corners are seen.",
    decided="The RMS is above 1 px.",
    usual_causes="A bent board, motion, a pitch that differs along the board's two directions.",
)

CORNERS_FAR_OFF = Code(
    "corners-far-off",
    "error",
    text="The corners lie {rms_px:.1f} px RMS from their predicted places, where 0.05 to 0.5 px is usual: the camera "
    "is of no use.",
    to_do="Check that the board is flat and still, and its columns and rows.",
    meaning="The camera does not explain where the corners are seen, not even roughly.",
    decided="The RMS is above 3 px.",
    usual_causes="Another board than told, frames of several cameras or of a zoomed lens.",
    fixed=True,
)

PITCH_BY_ROBOT = Code(
    "board-pitch-by-robot",
    "warning",
    text="The board's pitch is {pitch_mm:.3f} ± {uncertainty_mm:.3f} mm by the robot's moves, and told as {told_mm:g} mm: "
    "all lengths scale with it.",
    to_do="Measure it over several squares and correct cell.board.pitch_mm.",
    meaning="The robot moved the camera by lengths that do not fit the board's.",
    decided="They differ by more than 3 standard deviations, and by more than 0.1 %.",
    usual_causes="A board that was printed to another scale, a typing error.",
)

CAMERA_BY_ROBOT = Code(
    "camera-by-robot-differs",
    "warning",
    text="The robot's moves ask for another camera than the boards do, beyond both uncertainties: the stated one holds "
    "the difference.",
    to_do="Check that the board is flat and stands still, and the robot's accuracy.",
    meaning="Two ways to the same focal length do not agree.",
    decided="Chance gives such a difference in fewer than one of a thousand cells.",
    usual_causes="A bent board, a robot that is less accurate than told.",
)

CAMERA_MODEL = Code(
    "camera-model-chosen",
    "note",
    text={
        "plain": "The plain model was chosen: no other is significantly better on held-out views ({errors}).",
        "other": "The model chosen is '{model}': it is significantly better on held-out views ({errors}).",
    },
    by="than",
    meaning="The model was not told, so the views decided.",
    decided="Views that have no part in the fit are foretold significantly better.",
)

TERMS_AT_ZERO = Code(
    "distortion-terms-at-zero",
    "note",
    text="{terms}: fixed at zero, since views that have no part in the fit are not foretold better with more.",
    meaning="A coefficient that the views do not determine does harm where no board was seen.",
    decided="Held-out views are foretold no better with it.",
)

TILT_CORRELATED = Code(
    "tilt-and-centre-correlated",
    "note",
    text="Tilt and principal point are correlated by {correlation:.3f}: use them together, never one of them alone.",
    meaning="A tilted sensor and a shifted principal point look much alike.",
    decided="The correlation is above 0.9.",
)

CORNERS_LEFT_OUT = Code(
    "corners-left-out",
    "note",
    text=Plural(
        "{count} single corner was left out as an outlier.",
        "{count} single corners were left out as outliers.",
        by="count",
    ),
    meaning="Single corners that were misread do not count.",
    decided="They lie far beyond the scatter of the others.",
)

PITCH_NOT_CHECKED = Code(
    "board-pitch-not-checked",
    "note",
    text="The board's pitch, {pitch_mm:g} mm, is not checked: frames of it look the same at any pitch, and all lengths "
    "scale with it.",
    to_do="Measure it over several squares; of a board that stands still (cell.board.fixed) six robot poses check it.",
    meaning="Frames tell angles; only the board's pitch tells lengths.",
    decided="No robot poses are there that could tell lengths.",
)

BOARD_TURN_AMBIGUOUS = Code(
    "board-looks-the-same-turned",
    "note",
    text="The board looks the same turned by 180°, so the camera is right but a board's pose may be turned.",
    to_do="Take a chessboard with an odd sum of columns and rows, or ChArUco, where that matters.",
    meaning="Which end of the board is up cannot be seen.",
    decided="The board's pattern is the same after half a turn.",
)

FRAMES_IN_COLOUR = Code(
    "frames-in-colour",
    "note",
    text="{captures}: frames in colour were turned into grey; a camera that interpolates colours blurs the corners.",
    to_do="Let the camera give grey frames where it can.",
    meaning="Colours are interpolated between pixels, which moves edges a little.",
    decided="The file has three channels.",
)

BOARD_MAY_BE_MIRRORED = Code(
    "board-mirroring-not-seen",
    "note",
    text="A mirrored frame of this board looks like one that is not mirrored.",
    to_do="If the driver mirrors frames, turn it off.",
    meaning="Only ChArUco boards, and shifted circles in an even number of rows, tell a mirrored frame.",
    decided="The kind and the rows of the board.",
)
